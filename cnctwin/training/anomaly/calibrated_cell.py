"""A cell's recordings become models with thresholds: trained on the first part of the time, calibrated on the rest.

The scores that a threshold is fitted on are those of the processor itself (replayed_cell.py), with their correlation in time, the
gate, the peers and the dwell. Rows in a tool change are not trained on, so that a change stands out in the raw score.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cnctwin.errors import UsageError
from cnctwin.training.anomaly.frozen_week import frozen_week, segments
from cnctwin.training.anomaly.recorded_cell import TOOL_CHANGE, RecordedCell, Stretch
from cnctwin.training.anomaly.regimes import Ticks, fitted_preparation, held_run, standardised, tailed_preparations
from cnctwin.training.anomaly.replayed_cell import replayed
from cnctwin.training.anomaly.time_split import split
from cnctwin.training.anomaly.track import Track
from processors.joint_anomaly.config import Config
from processors.joint_anomaly.expectations import Expectations
from twin.anomaly.calibration import Calibration
from twin.anomaly.common_mode import Method
from twin.anomaly.detector import Detector, trained_model
from twin.anomaly.errors import ModelError
from twin.anomaly.golden import GoldenWeek
from twin.anomaly.manifest import Trained
from twin.anomaly.model import AnomalyModel
from twin.anomaly.preparation import Preparation
from twin.anomaly.threshold import fit_threshold

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
HOUR_S = 3600.0
HOUR_TICKS_MIN = 60
MAD_TO_SD = 1.4826


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingSettings:
    """The settings of a training. Durations in s; the settings of the processor are to be the same on the day.

    expectations: of the twin, by machine, where parts are compared; expectations_from: the folder that has them
    """

    features: tuple[str, ...]
    detector: Detector = field(default_factory=Detector)
    alerts_per_week: float = 1.0
    train_share: float = 0.5
    tick_s: float = 1.0
    dwell_ticks: int = 3
    clear_fraction: float = 0.8
    calm_s: float = 600.0
    common_mode: Method = Method.PARTS
    common_mode_factor: float = 0.5
    exclude_gated_peers: bool = False
    tail_s: float = 8.0
    look_back_s: float = 0.0
    at: str = ""
    expectations: Mapping[str, Expectations] = field(default_factory=dict)
    expectations_from: str = ""

    @property
    def ticks(self) -> Ticks:
        """The way recordings become rows."""
        return Ticks(
            features=self.features,
            tick_ms=round(self.tick_s * 1000),
            gap_ms=round(Config().gap_s_max * 1000),
            tail_s=self.tail_s,
            look_back_s=self.look_back_s,
        )

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of the processor joint_anomaly."""
        names = ("tick_s", "dwell_ticks", "clear_fraction", "calm_s", "common_mode", "common_mode_factor", "exclude_gated_peers")
        return {name: getattr(self, name) for name in (*names, "tail_s", "look_back_s")}

    @property
    def calm_ticks(self) -> int:
        """The ticks that end an alarm."""
        return round(self.calm_s / self.tick_s)


@dataclass(frozen=True, slots=True, eq=False)
class Calibrated:
    """The model of one machine with its threshold, its golden week, and what came out on the part that it was calibrated on.

    has_tool_changes: whether anything tells of them; gated_share: of the ticks; missing: what would tell of the place in the part
    """

    machine: str
    model: AnomalyModel
    golden: GoldenWeek
    training_hours: float
    has_tool_changes: bool
    gated_share: float
    alerts: int
    missing: tuple[str, ...] = ()


def calibrated_cell(
    cell: RecordedCell, asked: TrainingSettings, say: Callable[[str], None] = lambda _: None
) -> tuple[Calibrated, ...]:
    """All machines of the cell. Raises UsageError or ModelError where there is too little to train or calibrate on."""
    training, calibrating = split(cell, asked.train_share)
    say("learning what is usual")
    preparations = _preparations(cell.machines, training, asked)
    models, hours = {}, {}
    for machine in cell.machines:
        say(f"training {machine}")
        models[machine], hours[machine] = _trained(machine, cell, training, preparations.get(machine), asked)
        rows = rows_to_score(machine, calibrating, preparations.get(machine), asked)
        models[machine] = models[machine].calibrated(_provisional(machine, models[machine].scores(rows), asked))
    tracks = []
    for place, stretch in enumerate(calibrating):
        say(f"calibrating on stretch {place + 1} of {len(calibrating)}")
        tracks.append(replayed(stretch, models, {**asked.settings, "threshold": 1.0}))
    found = []
    for machine in cell.machines:
        own = [one[machine] for one in tracks if machine in one]
        model = models[machine].calibrated(_calibration(machine, models[machine], own, asked))
        golden, alerts = frozen_week(machine, {**models, machine: model}, calibrating, tracks, asked.ticks)
        shut = np.concatenate([track.gated for track in own])
        told = any(stretch[machine].has(TOOL_CHANGE) for stretch in calibrating if machine in stretch)
        found.append(Calibrated(machine, model, golden, hours[machine], told, float(shut.mean()), alerts))
    return tuple(found)


def _preparations(machines: Sequence[str], training: Sequence[Stretch], asked: TrainingSettings) -> dict[str, Preparation]:
    """Return what is usual in each operation of each machine, where features are judged and not scores."""
    if asked.common_mode != "features":
        return {}
    found = {}
    for machine in machines:
        held = [held_run(stretch[machine], asked.ticks) for stretch in training if machine in stretch]
        try:
            found[machine] = fitted_preparation(held, asked.ticks)
        except ValueError as error:
            raise UsageError(f"{machine}: {error}") from None
    try:
        return tailed_preparations(found, training, asked.ticks)
    except ValueError as error:
        raise UsageError(f"{', '.join(machines)}: {error}") from None


def rows_to_score(machine: str, stretches: Sequence[Stretch], preparation: Preparation | None, asked: TrainingSettings) -> Floats:
    """The rows of a machine that are wholly known and not gated, as the model takes them."""
    rows = [np.empty((0, len(asked.features)))]
    for stretch in stretches:
        if machine in stretch:
            held = held_run(stretch[machine], asked.ticks)
            values, judged = (held.rows, held.quiet) if preparation is None else standardised(preparation, held)
            rows.append(values[judged])
    return np.concatenate(rows)


def _trained(
    machine: str, cell: RecordedCell, training: Sequence[Stretch], preparation: Preparation | None, asked: TrainingSettings
) -> tuple[AnomalyModel, float]:
    runs = [stretch[machine] for stretch in training if machine in stretch]
    rows = rows_to_score(machine, training, preparation, asked)
    from_s, to_s = float(runs[0].t_s[0]), float(runs[-1].t_s[-1])
    about = Trained(machine=machine, at=asked.at, source=cell.files[machine], from_s=from_s, to_s=to_s)
    try:
        model = trained_model(asked.detector, rows, asked.features, about)
    except ModelError as error:
        raise UsageError(f"{machine}: {error}") from None
    return replace(model, preparation=preparation), len(rows) * asked.tick_s / HOUR_S


def _provisional(machine: str, raw: Floats, asked: TrainingSettings) -> Calibration:
    """Centre and spread of the raw score, from which z comes; the threshold is to be fitted yet."""
    if len(raw) < HOUR_TICKS_MIN:
        raise UsageError(
            f"{machine}: {len(raw)} rows outside tool changes to calibrate on, {HOUR_TICKS_MIN} are needed: record more"
        )
    center = float(np.median(raw))
    spread = MAD_TO_SD * float(np.median(np.abs(raw - center)))
    if not spread > 0.0:
        raise UsageError(
            f"{machine}: half of the scores are equal ({center:.3g}), so the model cannot tell normal from unusual; record more, "
            "or choose other --features"
        )
    unfitted: dict[str, Any] = {"threshold": 1.0, "estimate": 0.0, "low": 0.0, "high": 0.0, "hours": 0.0, "is_extrapolated": True}
    return Calibration(**asked.settings, **unfitted, alerts_per_week=asked.alerts_per_week, raw_center=center, raw_spread=spread)


def _calibration(machine: str, model: AnomalyModel, tracks: list[Track], asked: TrainingSettings) -> Calibration:
    before = model.calibration
    assert before is not None
    pieces = [(track.adjusted[piece], track.skipped[piece]) for track in tracks for piece in segments(track, asked.tick_s)]
    try:
        fit = fit_threshold(
            [scores for scores, _ in pieces],
            [gated for _, gated in pieces],
            asked.tick_s,
            asked.dwell_ticks,
            asked.clear_fraction,
            asked.alerts_per_week,
            asked.calm_ticks,
        )
    except ValueError as error:
        raise UsageError(f"{machine}: no threshold can be fitted: {error}") from None
    names = ("threshold", "estimate", "low", "high", "hours", "is_extrapolated", "clusters")
    means = hourly_means(tracks)
    return Calibration(**{**before.model_dump(), **{name: getattr(fit, name) for name in names}, "hourly_means": means})


def hourly_means(tracks: list[Track]) -> tuple[float, ...]:
    """Means of the raw score outside tool changes, by hour, of hours with at least a minute's ticks."""
    means = []
    for track in tracks:
        judged = ~track.gated & np.isfinite(track.raw)  # as the processor has it (processors/joint_anomaly/score_drift.py)
        hour, raw = (track.t_s[judged] // HOUR_S).astype(np.int64), track.raw[judged]
        if len(hour):
            counts = np.bincount(hour - hour[0])
            sums = np.bincount(hour - hour[0], weights=raw)
            means += (sums[counts >= HOUR_TICKS_MIN] / counts[counts >= HOUR_TICKS_MIN]).tolist()
    return tuple(means[-10_000:])
