"""The subsystems of a machine, each compared alone: which is as it was told, which is not, and by how much."""

from collections.abc import Sequence

import numpy as np

from twin.gap.diagnosis import Subsystem, Verdict
from twin.gap.fitting import Left
from twin.gap.parts.opened import Opened
from twin.gap.search import CHANCE_BLOCKS
from twin.gap.stages.axis import AxisStage
from twin.gap.stages.open_loop.stage import OpenStage
from twin.gap.stages.turns import TO_TOOTH
from twin.gap.verdict import Judged

DRIVEN_BY = {
    "force_x_n": ("cut", ("spindle_angle_rad", "axial_depth_mm", "entry_angle_rad", "exit_angle_rad")),
    "force_y_n": ("cut", ("spindle_angle_rad", "axial_depth_mm", "entry_angle_rad", "exit_angle_rad")),
    "spindle_load_pct": ("spindle load", ("spindle_rpm", "axial_depth_mm", "entry_angle_rad", "exit_angle_rad")),
    "tool_change_s": ("program", ("tool_change_active",)),
    "spindle_temp_c": ("heat", ("spindle_load_pct", "spindle_rpm", "ambient_temp_c")),
}
"""Signal of a stage → its subsystem, and what drives it."""


def subsystems_of(stages: Sequence[Judged], opened: Sequence[Opened]) -> tuple[Subsystem, ...]:
    """Return the subsystems, worst first."""
    found = [_of_loop(loop) for axis in opened for loop in (axis.judged if axis.decides else axis.loops.values())]
    for stage in stages:
        if not isinstance(stage.explained.stage, AxisStage | OpenStage):
            found += _of_signals(stage)
    return tuple(sorted(found, key=lambda s: -s.before))


def _of_loop(loop: Judged) -> Subsystem:
    stage = loop.explained.stage
    assert isinstance(stage, OpenStage)
    before, after = loop.explained.base.left.gap(), loop.explained.best.left.gap()
    driven = tuple(f"{stage.letter}_{column}" for column in stage.loop.driven_by)
    compared = f"{stage.letter}_{stage.loop.compared}"
    names = tuple(e.effect for e in loop.explained.best.effects)
    return Subsystem(stage.name, driven, compared, _figure(before), _figure(after), loop.verdict, names)


def _of_signals(stage: Judged) -> list[Subsystem]:
    """The subsystems of a stage that compares several signals, by signal."""
    base, best = stage.explained.base.left, stage.explained.best.left
    by_name: dict[str, list[str]] = {}
    for signal in base.signals:
        recorded = signal.removesuffix(TO_TOOTH)
        if recorded in DRIVEN_BY:
            by_name.setdefault(DRIVEN_BY[recorded][0], []).append(signal)
    found = []
    for name, signals in by_name.items():
        before, after = (_rms_of(left, signals) for left in (base, best))
        named = tuple(e.effect for e in stage.explained.best.effects) if after < 0.95 * before else ()
        verdict = _verdict(stage, signals, bool(named))
        found.append(Subsystem(name, DRIVEN_BY[signals[0]][1], signals[0], _figure(before), _figure(after), verdict, named))
    return found


def _rms_of(left: Left, signals: Sequence[str]) -> float:
    rms = dict(zip(left.signals, left.rms(), strict=True))
    return float(np.sqrt(np.mean([rms[signal] ** 2 for signal in signals])))


def _verdict(stage: Judged, signals: Sequence[str], named: bool) -> Verdict:
    """The verdict of a part of a stage, as `twin.gap.verdict` has it for the whole."""
    worst = stage.explained.stage.healthy_rms
    before, after = (
        max(dict(zip(left.signals, left.rms_but_worst(CHANCE_BLOCKS), strict=True))[signal] for signal in signals)
        for left in (stage.explained.base.left, stage.explained.best.left)
    )
    if not named:
        return Verdict.HEALTHY if before <= worst else Verdict.UNKNOWN
    return Verdict.EXPLAINED if after <= worst else Verdict.PARTLY


def _figure(floors: float) -> float:
    return float(f"{floors:.4g}")
