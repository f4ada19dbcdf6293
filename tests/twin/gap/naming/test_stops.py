"""The torque that an axis stops with: another one than the twin's is a gap, though there is little of it in a whole recording."""

from dataclasses import replace

import numpy as np

from tests.twin.gap.learned.pushed import healthy_stage, refitted
from tests.twin.gap.one_line import OneLine
from twin.gap.diagnosis import Verdict
from twin.gap.fitting import fitted
from twin.gap.naming.stops import stops_are_at_odds
from twin.gap.search import Explained
from twin.gap.stages.axis import AxisStage
from twin.gap.stages.axis_run import AxisRunData
from twin.gap.stages.stage import Model
from twin.gap.verdict import judged

MORE_A, RESTING = 0.08, 200
"""The torque that a brake adds, and the samples of rest at the end of a stretch."""


def braked(stage: AxisStage) -> AxisStage:
    """The same held by a brake wherever it comes to rest."""
    runs = []
    for run in stage.runs:
        torque = run.measured["torque_a"].copy()
        for stretch in run.stretches():
            rest = slice(stretch.stop - RESTING, stretch.stop)
            torque[rest] += MORE_A * np.sign(np.mean(torque[rest]))
        runs.append(replace(run, measured={**run.measured, "torque_a": torque}))
    return replace(stage, runs=tuple(runs))


def test_a_healthy_axis_stops_as_its_twin_does() -> None:
    stage = healthy_stage()
    assert not stops_are_at_odds(stage, refitted(stage))


def test_a_brake_shows_in_the_torque_at_the_stops() -> None:
    stage = braked(healthy_stage())
    base = refitted(stage)
    assert stops_are_at_odds(stage, base)
    assert judged(Explained(stage, base, base, (), {}, {}, stops=True)).verdict is Verdict.UNKNOWN


def test_a_stage_that_is_no_axis_has_no_stops() -> None:
    stage = OneLine()
    assert not stops_are_at_odds(stage, fitted(stage, Model(stage.constants, ()), np.zeros(1)))


def test_a_recording_that_ends_in_motion_does_not_stop_there() -> None:
    stage = healthy_stage()
    cut = replace(stage, runs=tuple(cut_in_motion(run) for run in stage.runs))
    assert not stops_are_at_odds(cut, refitted(cut))


def cut_in_motion(run: AxisRunData) -> AxisRunData:
    """The same until 0.1 s before it comes to rest for the last time."""
    end = run.stretches()[-1].stop - RESTING - 100
    measured, floor = ({name: values[:end] for name, values in whole.items()} for whole in (run.measured, run.floor))
    known = replace(run, t_s=run.t_s[:end], reference_mm=run.reference_mm[:end], regime=run.regime[:end], measured=measured)
    return replace(known, floor=floor, around={}, others={})
