"""The floor of an open loop from the laps of one run: pushes in one of them are gap and not floor."""

from tests.twin.gap import pushed_axis
from tests.twin.gap.small_case import case_of
from twin.gap.inspection import inspected
from twin.gap.stages.open_loop.plan import open_stages
from twin.gap.stages.plan import axis_stage, ground_of


def mechanics_floor(pushed: tuple[int, ...]) -> float:
    """Return the mean floor of the mechanics alone, over five laps."""
    log = pushed_axis.recorded(5, pushed)
    checked, _ = inspected(case_of(pushed_axis.MACHINE, {"run": {"t_s": log.t_s} | dict(log.columns)}))
    ground = ground_of(checked, frozenset())
    closed = axis_stage(ground, "x", {})
    assert closed is not None
    stages = {stage.loop.name: stage for stage in open_stages(closed, ground.runs, ground.repeats, ground.floors)}
    return float(stages["mechanics"].observed[0].floor.mean())


def test_pushes_in_a_lap_hardly_raise_the_floor_of_the_mechanics() -> None:
    assert mechanics_floor((2,)) < 2.0 * mechanics_floor(())
