"""An axis in a recorded run, or in the mean of repeated ones: what it was told, what it answered, and how well that repeats."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twin.case import Run
from twin.gap.floors import Floors
from twin.gap.labels import regime_labels
from twin.gap.sampling.servo_ticks import DOUBT
from twin.gap.stages.smoothed import filled, low_passed
from twin.gap.stages.temperature_rise import temperature_rise
from twin.learned.arguments import around, motion_arguments, other_axes
from twin.regimes import axis_regimes, motion_stretches
from twin.runlog import RunLog

Floats = NDArray[np.float64]
OUTPUTS = {"pos_mm": "position_mm", "torque_a": "torque_a", "table_mm": "table_mm"}
"""Column of the run log, without the letter → output of the loops."""
MOVED_HZ = 15.0
"""Cutoff of a measured motion that stands for a reference."""


@dataclass(frozen=True, eq=False)
class AxisRunData:
    """An axis in one run, or in the mean of repeated ones; (n,) each, as `twin.runlog` has them.

    disturbance_n: known force that resists motion in +, or None; measured: output → values; count: of the runs averaged
    regime: number of the regime (`twin.gap.labels`)
    rise_k: of the spindle's temperature since the start; rise_error: its standard error, relative
    others: letter → reference of the other axes; around: what a learned term may depend on of the machine as a whole
    told: whether the reference was recorded, else the measured position is it
    doubt: (n,) where the reference is not known well enough between samples, or None
    """

    name: str
    t_s: Floats
    reference_mm: Floats
    measured: Mapping[str, Floats]
    floor: Mapping[str, Floats]
    regime: NDArray[np.int8]
    rise_k: Floats | None
    disturbance_n: Floats | None
    count: int
    fitted: bool
    others: Mapping[str, Floats] = field(default_factory=dict)
    around: Mapping[str, Floats] = field(default_factory=dict)
    told: bool = True
    doubt: NDArray[np.bool_] | None = None
    rise_error: float = 0.0

    @cached_property
    def arguments(self) -> Mapping[str, Floats]:
        """Arguments of learned terms of the axis, column → (n,): its measured motion, its commands, the time."""
        position = self.measured.get("pos_mm", self.measured.get("table_mm", self.reference_mm))
        position = np.where(np.isfinite(position), position, self.reference_mm)
        torque = np.nan_to_num(self.measured.get("torque_a", np.zeros(len(self.t_s))))
        motion = motion_arguments(self.t_s, self.reference_mm) | {"position_mm": position, "torque_a": torque, "t_s": self.t_s}
        return dict(self.around) | motion | other_axes(self.t_s, self.others)

    def of_loops(self, values: Floats) -> Floats:
        """Return values, (n,), with NaN where the loops saw a reference that is not known well enough."""
        return values if self.doubt is None else np.where(self.doubt, np.nan, values)

    @property
    def period_s(self) -> float:
        """Between samples, s."""
        return float(self.t_s[1] - self.t_s[0])

    def stretches(self) -> tuple[slice, ...]:
        """Return the stretches of motion."""
        return self._stretches

    @cached_property
    def _stretches(self) -> tuple[slice, ...]:
        return motion_stretches(self.t_s, self.reference_mm)


def axis_run_data(
    group: Sequence[Run], letter: str, floors: Floors, disturbance_n: Floats | None, fitted: bool
) -> AxisRunData | None:
    """An axis in a run, or in repeated ones averaged; None where they do not record it."""
    log = group[0].log
    told = log.has(f"{letter}_ref_mm")
    reference = log.columns[f"{letter}_ref_mm"] if told else _moved_mm(group, letter)
    outputs = [output for output in OUTPUTS if all(run.log.has(f"{letter}_{output}") for run in group)]
    if reference is None or not outputs or not motion_stretches(log.t_s, reference):
        return None
    measured = {o: np.mean([run.log[f"{letter}_{o}"] for run in group], axis=0) for o in outputs}
    floor = {o: floors.of(log, f"{letter}_{o}") for o in outputs}
    regime = regime_labels(log, f"{letter}_ref_mm", floors.machine)[1] if told else axis_regimes(log.t_s, reference)
    others = {a: log[f"{a}_ref_mm"] for a in log.axes() if a != letter and log.has(f"{a}_ref_mm")}
    rise = temperature_rise(floors.machine, group)
    return AxisRunData(
        group[0].name,
        log.t_s,
        reference,
        measured,
        floor,
        regime,
        None if rise is None else rise.rise_k,
        disturbance_n,
        len(group),
        fitted,
        others,
        around(log.t_s, log.columns),
        told,
        _doubt(group, letter),
        0.0 if rise is None else rise.error,
    )


def _doubt(group: Sequence[Run], letter: str) -> NDArray[np.bool_] | None:
    known = [run.log.columns[f"{letter}_{DOUBT}"] > 0.0 for run in group if f"{letter}_{DOUBT}" in run.log.columns]
    return np.any(known, axis=0) if known else None


def _moved_mm(group: Sequence[Run], letter: str) -> Floats | None:
    """The measured position, smoothed, to stand for a reference that was not recorded."""
    if not all(run.log.has(f"{letter}_pos_mm") for run in group) or len({len(run.log) for run in group}) > 1:
        return None
    log = group[0].log
    position = filled(np.mean([run.log[f"{letter}_pos_mm"] for run in group], axis=0))
    return low_passed(position, float(log.t_s[1] - log.t_s[0]), MOVED_HZ)


def repeated_groups(runs: Sequence[Run], repeats: Sequence[tuple[Run, Run]]) -> tuple[tuple[Run, ...], ...]:
    """Runs of one program with the same references, together."""
    groups: list[list[Run]] = []
    for run in runs:
        for group in groups:
            if any({run, other} == set(pair) for other in group for pair in repeats) and _same_reference(group[0].log, run.log):
                group.append(run)
                break
        else:
            groups.append([run])
    return tuple(tuple(group) for group in groups)


def _same_reference(one: RunLog, other: RunLog) -> bool:
    names = [n for n in one.columns if n.endswith("_ref_mm")]
    return len(one) == len(other) and all(n in other.columns and np.allclose(one[n], other[n], atol=1e-6) for n in names)
