"""`cnctwin train anomaly`, `train check` and `train promote`: what they do, and what they say of it."""

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from cnctwin.errors import UsageError
from cnctwin.terminal.spinner import working
from cnctwin.training.anomaly.calibrated_cell import Calibrated, TrainingSettings, calibrated_cell
from cnctwin.training.anomaly.calibrated_parts import calibrated_parts
from cnctwin.training.anomaly.frozen_week import segments
from cnctwin.training.anomaly.recorded_cell import recorded_cell, shared_features
from cnctwin.training.anomaly.replayed_cell import replayed
from processors.joint_anomaly.config import FITTED_WITH
from processors.joint_anomaly.expectations import Expectations, read_expectations
from twin.anomaly.alarm import is_alarm, onsets
from twin.anomaly.common_mode import Method
from twin.anomaly.detector import Detector
from twin.anomaly.errors import ModelError
from twin.anomaly.golden import WEEK_S
from twin.anomaly.golden_check import checked, most_alerts
from twin.anomaly.model import CURRENT, AnomalyModel, load_golden, load_model, load_models
from twin.anomaly.store import current_of, promote, stored
from twin.errors import TwinError
from twin.forest.artefact import MANIFEST

FEATURES = ("spindle_load_pct", "spindle_rpm", "feed_mm_min", "spindle_temp_c", "vibration_rms_g")
"""The published ones, of which those are taken that all files have."""
__all__ = ["Detector", "Method", "TrainingSettings", "check_models", "expectations_in", "promote_model", "train_anomaly"]


def train_anomaly(arguments: Sequence[str], asked: TrainingSettings, out: Path, *, as_json: bool, console: Console) -> None:
    """Train and calibrate the machines of a cell. A model that fails on the golden week of the one before is not promoted."""
    if not asked.features:
        asked = replace(asked, features=shared_features(arguments, FEATURES))
    cell = recorded_cell(arguments, asked.features, asked.tick_s)
    try:
        with working("training") as say:
            calibrated = calibrated_parts if asked.common_mode is Method.PARTS else calibrated_cell
            found = calibrated(cell, asked, say)
        lines = [_kept(one, out) for one in found]
    except TwinError as error:
        raise UsageError(str(error)) from None
    if as_json:
        sys.stdout.write(json.dumps({"settings": asked.settings, "machines": lines}) + "\n")
        return
    for line in lines:
        for sentence in _sentences(line):
            console.print(sentence, markup=False, highlight=False, soft_wrap=True)
    console.print(f"\n{configuration(asked, out)}", markup=False, highlight=False, soft_wrap=True)


def expectations_in(folder: Path | None) -> dict[str, Expectations]:
    """Return what the twin expects, by machine. Raises UsageError where a file cannot be read."""
    try:
        return read_expectations("" if folder is None else str(folder))
    except ValueError as error:
        raise UsageError(f"--expectations: {error}") from None


def configuration(asked: TrainingSettings, out: Path) -> str:
    """Return what belongs in the processor's configuration: a threshold holds for the settings that it was fitted with."""
    expected = {"expectations": asked.expectations_from} if asked.expectations_from else {}
    lines = [f"{name} = {json.dumps(value)}" for name, value in {"models": str(out), **expected, **asked.settings}.items()]
    return "\n".join(["[joint_anomaly]", *lines])


def check_models(folder: Path, arguments: Sequence[str], against: Path | None, *, as_json: bool, console: Console) -> int:
    """The golden weeks of models, or what they say of recordings; exit code 1 where one does not pass."""
    try:
        models = _models(folder)
        lines = _on_files(models, arguments) if arguments else _on_golden(folder, models, against)
    except TwinError as error:
        raise UsageError(str(error)) from None
    if as_json:
        sys.stdout.write(json.dumps(lines) + "\n")
    else:
        for line in lines:
            faults = "; ".join(line["faults"]) or "passes"
            alerts = f"{line['alerts']} alerts in {line['weeks']:.3g} machine-weeks, at most {line['alerts_max']}"
            told = f"{line['machine']}: {faults}: {alerts}"
            console.print(told, markup=False, highlight=False, soft_wrap=True)
    return 1 if any(line["faults"] for line in lines) else 0


def promote_model(models: Path, machine: str, version: str, console: Console) -> None:
    """Turn the link of a machine to another of its models."""
    try:
        before = promote(models, machine, version)
        now = current_of(models, machine)
    except ModelError as error:
        raise UsageError(str(error)) from None
    console.print(f"{machine}: {now} scores, before it {before or 'none'}", markup=False, highlight=False, soft_wrap=True)


def _kept(one: Calibrated, out: Path) -> dict[str, Any]:
    """The model in its folder, the current one unless it fails on the golden week of the one before; what is to be said."""
    before = current_of(out, one.machine)
    folder = stored(one.model, out, one.machine, one.golden)
    why_not = "" if before is None or before == folder.name else _fails_beside(one.model, out / one.machine / CURRENT)
    if not why_not:
        promote(out, one.machine, folder.name)
    found = one.model.calibration
    assert found is not None
    return {
        "machine": one.machine,
        "model": str(folder),
        "before": before,
        "not_promoted": why_not,
        "features": list(one.model.features),
        "rows": one.model.trained.rows,
        "training_hours": one.training_hours,
        "calibration_hours": found.hours,
        "threshold": found.threshold,
        "alerts_per_week": found.alerts_per_week,
        "estimate": found.estimate,
        "low": found.low,
        "high": found.high,
        "is_extrapolated": found.is_extrapolated,
        "clusters": found.clusters,
        "has_tool_changes": one.has_tool_changes,
        "gated_share": one.gated_share,
        "alerts": one.alerts,
        "drift_hours": len(found.hourly_means),
        "missing": list(one.missing),
    }


def _fails_beside(model: AnomalyModel, champion: Path) -> str:
    golden = load_golden(champion)
    if golden is None:
        return ""
    try:
        return "; ".join(checked(model, golden, is_challenger=True).faults)
    except ModelError:
        return ""  # other features or another tick: it was asked for, and there is nothing to compare


def _sentences(line: dict[str, Any]) -> list[str]:
    told = [
        f"{line['machine']}: trained on {line['rows']} rows ({line['training_hours']:.1f} h), calibrated on "
        f"{line['calibration_hours']:.1f} h, {100 * line['gated_share']:.1f} % of it gated",
        f"  threshold {line['threshold']:.4g}: {line['estimate']:.2g} alerts a machine-week (90 % interval {line['low']:.2g} to "
        f"{line['high']:.2g}), {line['alerts_per_week']:g} asked for"
        + ("; extrapolated: no score of the recording reaches it" if line["is_extrapolated"] else ""),
    ]
    if not line["has_tool_changes"]:
        told.append("  nothing tells of tool changes (no tool_change_active): none of its scores is gated")
    if line["missing"]:
        told.append(f"  the recordings tell no {', '.join(line['missing'])}: a part is known as far as the others go")
    if line["not_promoted"]:
        told.append(
            f"  NOT promoted: on the golden week of {line['before']}: {line['not_promoted']}; cnctwin train promote does it"
        )
    told.append(f"  {line['model']}")
    return told


def _models(folder: Path) -> dict[str, tuple[Path, AnomalyModel]]:
    """Return the models of a folder with models, of one machine's, or of one version."""
    if (folder / MANIFEST).exists() or (folder / CURRENT).exists():
        model = load_model(folder)
        return {model.trained.machine or folder.name: (folder, model)}
    return {machine: (folder / machine, model) for machine, model in load_models(folder).items()}


def _on_golden(folder: Path, models: dict[str, tuple[Path, AnomalyModel]], against: Path | None) -> list[dict[str, Any]]:
    lines = []
    for machine, (own, model) in models.items():
        place = (
            own
            if against is None
            else against
            if (against / MANIFEST).exists() or (against / CURRENT).exists()
            else against / machine
        )
        golden = load_golden(place)
        if golden is None:
            raise ModelError(f"{place}: no golden week was frozen with it: cnctwin train anomaly freezes one")
        lines.append({"machine": machine, **asdict(checked(model, golden, is_challenger=against is not None))})
    return lines


def _on_files(models: dict[str, tuple[Path, AnomalyModel]], arguments: Sequence[str]) -> list[dict[str, Any]]:
    """Alerts in recordings, beside what the threshold stands for."""
    first = next(iter(models.values()))[1]
    if first.calibration is None:
        raise ModelError("the model has no threshold, so no alerts to count: cnctwin train anomaly fits one")
    features = sorted({name for _, model in models.values() for name in model.features})
    cell = recorded_cell(arguments, features, first.calibration.tick_s)
    if unknown := [machine for machine in cell.machines if machine not in models]:
        there = ", ".join(models)
        raise UsageError(f"there is no model of {unknown[0]}; there are {there}: name the files, as {next(iter(models))}=FILE")
    settings = {name: getattr(first.calibration, name) for name in FITTED_WITH}
    scorers = {machine: models[machine][1] for machine in cell.machines}
    alerts, ticks = dict.fromkeys(cell.machines, 0), dict.fromkeys(cell.machines, 0)
    for stretch in cell.stretches:
        for machine, track in replayed(stretch, scorers, {**settings, "threshold": 1.0}).items():
            found = scorers[machine].calibration
            if found is None or {name: getattr(found, name) for name in FITTED_WITH} != settings:
                raise ModelError(
                    f"the models of {machine} and {cell.machines[0]} were calibrated with different settings: check them apart"
                )
            rule = found.rule
            ticks[machine] += int((~track.skipped & np.isfinite(track.adjusted)).sum())
            for piece in segments(track, found.tick_s):
                alerts[machine] += len(onsets(is_alarm(rule, track.adjusted[piece], track.skipped[piece])))
    lines = []
    for machine in cell.machines:
        weeks = ticks[machine] * first.calibration.tick_s / WEEK_S
        most = most_alerts(first.calibration.alerts_per_week * weeks)
        faults = [f"{alerts[machine]} alerts; its threshold stands for at most {most}"] if alerts[machine] > most else []
        lines.append({"machine": machine, "weeks": weeks, "alerts": alerts[machine], "alerts_max": most, "faults": faults})
    return lines
