"""A cell's recordings become models that compare parts: learned on the first part of the time, thresholds fitted on the rest.

A part that alarms teaches nothing, so what is learned depends on the threshold. The rest is judged twice: with no threshold,
which gives a first one, and with that; the threshold that is kept is fitted on the second.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from cnctwin.errors import UsageError
from cnctwin.training.anomaly.calibrated_cell import HOUR_S, Calibrated, TrainingSettings, hourly_means
from cnctwin.training.anomaly.frozen_week import segments
from cnctwin.training.anomaly.parts_cell import PartTicks, cell_of_parts, missing_of_parts, tracks_of_parts
from cnctwin.training.anomaly.recorded_cell import TOOL_CHANGE, RecordedCell
from cnctwin.training.anomaly.time_split import split
from cnctwin.training.anomaly.track import Track
from twin.anomaly.alarm import AlarmRule, is_alarm, onsets
from twin.anomaly.calibration import Calibration
from twin.anomaly.errors import ModelError
from twin.anomaly.golden_check import frozen_parts
from twin.anomaly.manifest import Trained
from twin.anomaly.model import AnomalyModel
from twin.anomaly.parts.replay import Recorded, fit
from twin.anomaly.parts_scorer import PartsScorer
from twin.anomaly.refit import versions
from twin.anomaly.threshold import Threshold, fit_threshold

MAD_TO_SD = 1.4826
SPREAD_LEAST = 1e-3
"""Least spread of a raw score, in tails of healthy parts; one that is nearly always the same has less."""


def calibrated_parts(
    cell: RecordedCell, asked: TrainingSettings, say: Callable[[str], None] = lambda _: None
) -> tuple[Calibrated, ...]:
    """All machines of the cell. Raises UsageError where there is too little to learn from, or to fit a threshold on."""
    training, calibrating = split(cell, asked.train_share)
    ticks = part_ticks(asked)
    say("learning the parts")
    learning = cell_of_parts(cell.machines, training, ticks)
    try:
        models = fit(learning)
    except ValueError as error:
        raise UsageError(f"{', '.join(cell.machines)}: {error}") from None
    rest = cell_of_parts(cell.machines, calibrating, ticks)
    say("calibrating, with no threshold yet")
    tracks = tracks_of_parts(rest, models, None)
    rules = [_rule(_fitted(one.machine, track, asked), asked) for one, track in zip(rest, tracks, strict=True)]
    say("calibrating")
    tracks = tracks_of_parts(rest, models, rules)
    found = []
    for place, machine in enumerate(cell.machines):
        known = learning[place].is_known
        rows = len(learning[place].values) if known is None else int(known.sum())
        from_s, to_s = _window(training, machine)
        about = Trained(
            machine=machine, at=asked.at, source=cell.files[machine], from_s=from_s, to_s=to_s, rows=rows, versions=versions()
        )
        scorer = PartsScorer(models[place])
        calibration = _calibration(tracks[place], _fitted(machine, tracks[place], asked), asked)
        model = AnomalyModel(models[place].signals, scorer, about, calibration)
        told = any(stretch[machine].has(TOOL_CHANGE) for stretch in calibrating if machine in stretch)
        missing = missing_of_parts(cell.stretches, machine)
        found.append(_calibrated(model, rest[place], tracks[place], told, missing))
    return tuple(found)


def part_ticks(asked: TrainingSettings) -> PartTicks:
    """Return the way recordings become ticks of parts."""
    ticks = asked.ticks
    return PartTicks(
        signals=asked.features,
        tick_ms=ticks.tick_ms,
        gap_ms=ticks.gap_ms,
        tail_s=asked.tail_s,
        look_back_s=asked.look_back_s,
        expectations=asked.expectations,
    )


def _window(stretches: Sequence[Mapping[str, Any]], machine: str) -> tuple[float, float]:
    runs = [stretch[machine] for stretch in stretches if machine in stretch]
    return float(runs[0].t_s[0]), float(runs[-1].t_s[-1])


def _rule(fitted: Threshold, asked: TrainingSettings) -> AlarmRule:
    return AlarmRule(fitted.threshold, asked.dwell_ticks, asked.clear_fraction, asked.calm_ticks)


def _fitted(machine: str, track: Track, asked: TrainingSettings) -> Threshold:
    pieces = segments(track, asked.tick_s)
    try:
        return fit_threshold(
            [track.adjusted[piece] for piece in pieces],
            [track.skipped[piece] for piece in pieces],
            asked.tick_s,
            asked.dwell_ticks,
            asked.clear_fraction,
            asked.alerts_per_week,
            asked.calm_ticks,
        )
    except (ValueError, ModelError) as error:
        raise UsageError(f"{machine}: no threshold can be fitted: {error}") from None


def _calibration(track: Track, fitted: Threshold, asked: TrainingSettings) -> Calibration:
    raw = track.raw[~track.skipped & np.isfinite(track.raw)]
    center = float(np.median(raw)) if len(raw) else 0.0
    spread = MAD_TO_SD * float(np.median(np.abs(raw - center))) if len(raw) else 0.0
    names = ("threshold", "alerts_per_week", "estimate", "low", "high", "hours", "is_extrapolated", "clusters")
    return Calibration(
        **asked.settings,
        **{name: getattr(fitted, name) for name in names},
        raw_center=center,
        raw_spread=max(spread, SPREAD_LEAST),
        hourly_means=hourly_means([track]),
    )


def _calibrated(
    model: AnomalyModel, recorded: Recorded, track: Track, has_tool_changes: bool, missing: tuple[str, ...]
) -> Calibrated:
    found = model.calibration
    assert found is not None
    rule = found.rule
    alerts = sum(
        len(onsets(is_alarm(rule, track.adjusted[piece], track.skipped[piece]))) for piece in segments(track, found.tick_s)
    )
    golden = frozen_parts(model, recorded, track.skipped, track.adjusted)
    hours = model.trained.rows * found.tick_s / HOUR_S
    shut = float(track.gated.mean()) if len(track.gated) else 0.0
    return Calibrated(model.trained.machine, model, golden, hours, has_tool_changes, shut, alerts, missing)
