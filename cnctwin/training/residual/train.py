"""`cnctwin train residual`: what it does, and what it says of it."""

import json
import sys
import tempfile
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table as Printed

from cnctwin.errors import UsageError
from cnctwin.machines.folder import MachineFolder
from cnctwin.machines.place import machines_folder
from cnctwin.memory.store.opening import default_place, open_store
from cnctwin.models.registry import add, shelf
from cnctwin.terminal.spinner import working
from cnctwin.terminal.still_needed import DATED_S, StillNeeded
from cnctwin.training.residual.recording import from_files, from_store
from processors.config import Configuration, read_tables
from processors.errors import ConfigurationError
from processors.thermal import PROCESSOR as THERMAL
from processors.thermal import Config as ThermalConfig
from processors.thermal import described
from twin.errors import MachineError, TwinError
from twin.residual.model import FOLDER, Trained, save_model
from twin.residual.physics import Physics
from twin.residual.table import Recorded
from twin.residual.training import Outcome, TrainingSettings, trained

__all__ = ["TrainingSettings", "Wanted", "train_residual"]
HOURS_MIN = 40.0
"""Hours of cutting, as the published recipe asks for."""
HELD_SHARE_MIN, HELD_SHARE_MAX = 0.1, 0.6


@dataclass(frozen=True, slots=True)
class Wanted:
    """The residual that is wanted: of which machine, from run logs, or a stretch of a store (ms since 1970; None = all)."""

    machine: str
    files: tuple[Path, ...] = ()
    store: str = ""
    from_ms: int | None = None
    to_ms: int | None = None
    config: Path | None = None
    machines: Path | None = None
    hours_min: float = HOURS_MIN


def train_residual(wanted: Wanted, asked: TrainingSettings, out: Path, *, as_json: bool, console: Console) -> int:
    """Train, judge, and put the model into the registry, unless it is worthless; exit code 1 where it is."""
    if not HELD_SHARE_MIN <= asked.held_share <= HELD_SHARE_MAX:
        raise UsageError(
            f"--held-share {asked.held_share:g}: {HELD_SHARE_MIN:g} to {HELD_SHARE_MAX:g} of the time can be held out"
        )
    physics = physics_of(wanted.config, wanted.machine, wanted.machines)
    now = datetime.now(UTC)
    try:
        with working("reading") as say:
            recorded = _recorded(wanted, physics, say)
            if (hours := recorded.cutting_hours) < wanted.hours_min:
                raise UsageError(
                    f"{wanted.machine}: not enough to train on yet\n  {_needed(recorded, wanted.hours_min).sentence()}\n"
                    f"  record on, or allow fewer with --hours-min {max(hours - 0.05, 0.0):.1f}"
                )
            about = Trained(
                machine=wanted.machine,
                at=now.isoformat(timespec="seconds"),
                source=tuple(map(str, wanted.files)) or (wanted.store or str(default_place()),),
                physics=physics,
            )
            done = trained(recorded, asked, about, say)
            kept = "" if done.model.held_out.why_refused else _kept(done, wanted.machine, out, now.timestamp())
    except TwinError as error:
        raise UsageError(str(error)) from None
    told = summary_of(done, recorded) | {"model": kept or None, "hours_min": wanted.hours_min}
    if as_json:
        sys.stdout.write(json.dumps(told) + "\n")
    else:
        _print(told, done, out, console)
    return 0 if kept else 1


def physics_of(config: Path | None, machine: str, machines: Path | None = None) -> Physics:
    """The heat that `thermal` has for a machine: by its description, by a configuration of processors, or as is assumed."""
    folder = machines_folder(machines, config)
    try:
        table = read_tables(config).get(THERMAL.name, {}) if config else {}
        own: ThermalConfig = Configuration(ThermalConfig, table, name=THERMAL.name).of(machine)
        description = None if folder is None else MachineFolder(folder, machine).live()
    except (ConfigurationError, MachineError) as error:
        raise UsageError(str(error)) from None
    heat = described(own, description)
    return Physics.of(heat.machine, own.ambient_temp_c, heat.version)


def _needed(recorded: Recorded, hours_min: float) -> StillNeeded:
    """Return how much cutting is still needed; the rate is that of the calendar where the times have a date."""
    begin_s, end_s = float(recorded.t_s[0]), float(recorded.t_s[-1])
    over_h = (end_s - begin_s) / 3600.0 if begin_s > DATED_S else recorded.hours
    return StillNeeded("cutting (the spindle turns and the axes feed)", recorded.cutting_hours, hours_min, over_h, end_s)


def _recorded(wanted: Wanted, physics: Physics, say: Any) -> Recorded:
    if wanted.files:
        return from_files(wanted.files, physics, say)
    store = open_store(wanted.store or default_place(), writable=False)
    try:
        return from_store(store, wanted.machine, (wanted.from_ms, wanted.to_ms), physics, say)
    finally:
        store.close()


def _kept(done: Outcome, machine: str, out: Path, at_s: float) -> str:
    """The version, now in the registry; the first of a machine counts at once."""
    with tempfile.TemporaryDirectory(prefix="cnctwin-residual-") as aside:
        return add(out, FOLDER, machine, save_model(done.model, Path(aside)), at_s)


def summary_of(done: Outcome, recorded: Recorded) -> dict[str, Any]:
    """All figures, for a program to read."""
    held, trained_on = done.model.held_out, done.model.trained
    return {
        "machine": trained_on.machine,
        "hours": recorded.hours,
        "cutting_hours": recorded.cutting_hours,
        "physics": trained_on.physics.model_dump(),
        "feature_set": trained_on.feature_set,
        "features": [str(one) for one in done.model.features],
        "choosing_rmse_k": dict(done.choosing),
        "rows": trained_on.rows,
        "held_out": held.model_dump(mode="json"),
        "refused": held.why_refused or None,
    }


def _print(told: dict[str, Any], done: Outcome, out: Path, console: Console) -> None:
    held, machine = done.model.held_out, told["machine"]
    lines = [
        f"{machine}: {told['hours']:.1f} h recorded, {told['cutting_hours']:.1f} h of cutting; trained on {told['rows']} rows, "
        f"judged on the last {held.hours:.1f} h, {held.gap_s / 3600:.1f} h apart from them",
        f"gain over the physics alone: {held.gain}, 90 % interval of {held.blocks} blocks; RMSE {held.physics_rmse_k:.2f} K, "
        f"corrected {held.corrected_rmse_k:.2f} K",
        f"gain over the physics and a constant: {held.over_constant}",
        f"a line through the same features: {held.linear_rmse_k:.2f} K",
        f"in the region of training: {100 * held.in_region:.0f} % of the held-out time",
        f"feature set {told['feature_set']}, by the error on the last part of the training time: "
        + ", ".join(f"{name} {error:.2f} K" for name, error in told["choosing_rmse_k"].items()),
    ]
    if told["hours_min"] < HOURS_MIN:
        lines.append(f"fewer hours were allowed than the {HOURS_MIN:g} h of cutting that are asked for: {told['hours_min']:g}")
    for line in lines:
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    regimes = Printed(title="held-out time by regime", title_justify="left")
    for column in ("regime", "share", "physics, K", "corrected, K"):
        regimes.add_column(column)
    for name, (physics, corrected, share) in held.by_regime.items():
        regimes.add_row(name, f"{100 * share:.0f} %", f"{physics:.2f}", f"{corrected:.2f}")
    worth = Printed(title="what a feature is worth: RMSE that is lost where it is shuffled, held-out time", title_justify="left")
    for column in ("feature", "K"):
        worth.add_column(column)
    for name, value in held.importance.items():
        worth.add_row(name, f"{value:.3f}")
    console.print(regimes)
    console.print(worth)
    for line in _ends(told, held.why_refused, out):
        console.print(line, markup=False, highlight=False, soft_wrap=True)


def _ends(told: dict[str, Any], refused: str, out: Path) -> list[str]:
    if refused:
        return [f"NO MODEL: {refused}"]
    machine, version = told["machine"], told["model"]
    pointer = shelf(out, FOLDER, machine).pointer()
    counts = pointer is not None and pointer.champion == version
    return [
        f"model {version} in {out / FOLDER / machine / version}",
        "it counts from the next start of the processor on"
        if counts
        else f"{pointer.champion if pointer else 'another'} goes on counting: cnctwin model compare decides between the two",
        f'\n[residual]\nmodels = "{out}"',
    ]
