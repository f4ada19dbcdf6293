"""The open loops of the axis of a small case."""

from twin.case import Case
from twin.gap.inspection import inspected
from twin.gap.stages.open_loop.plan import open_stages
from twin.gap.stages.open_loop.stage import OpenStage
from twin.gap.stages.plan import axis_stage, ground_of


def loops_of_case(case: Case) -> dict[str, OpenStage]:
    """Return name → open loop of axis z."""
    checked, _ = inspected(case)
    ground = ground_of(checked, frozenset())
    closed = axis_stage(ground, "z", {})
    assert closed is not None
    return {stage.loop.name: stage for stage in open_stages(closed, ground.runs, ground.repeats, ground.floors)}
