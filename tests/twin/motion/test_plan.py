"""Look-ahead, events and sampling: hand-made figures, and the laws of every plan."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.programs.columns import program_columns
from twin.errors import MachineError, PartProgramError
from twin.machine import Program
from twin.motion.candidates import Candidates
from twin.motion.limits import Limits
from twin.motion.motion import ExecState
from twin.motion.path import Path, path_from_moves
from twin.motion.plan import plan
from twin.motion.sampling import sampled
from twin.programs import canonical

LIMITS = Limits(rapid_mm_min=36000.0, acceleration_mm_s2=2500.0, jerk_mm_s3=60000.0, corner_speed_difference_mm_min=500.0)
TRAPEZOID = LIMITS.with_(jerk_mm_s3=math.inf)


def line(*ends: tuple[float, float, float], feed: float = 3000.0) -> Path:
    return path_from_moves([canonical.Linear(k, end, feed) for k, end in enumerate(ends)])


def test_length_over_feed_and_a_ramp_at_each_end() -> None:
    assert plan(line((100.0, 0.0, 0.0)), TRAPEZOID).total_s == pytest.approx(2.0 + 50.0 / 2500.0)
    assert plan(line((100.0, 0.0, 0.0)), LIMITS).total_s == pytest.approx(2.0 + 2.0 * math.sqrt(50.0 / 60000.0))


def test_a_square_corner_is_passed_at_the_permissible_speed_difference() -> None:
    planned = plan(line((50.0, 0.0, 0.0), (50.0, 50.0, 0.0)), LIMITS)
    assert planned.exit_mm_s[0] == pytest.approx(500.0 / 60.0)
    assert planned.entry_mm_s[1] == pytest.approx(500.0 / 60.0)


def test_a_corner_of_45_degrees_is_bound_by_the_axis_that_changes_most() -> None:
    planned = plan(line((50.0, 0.0, 0.0), (100.0, 50.0, 0.0)), LIMITS)
    assert planned.exit_mm_s[0] == pytest.approx(500.0 / 60.0 / math.sqrt(0.5))  # y goes from 0 to sqrt(1/2)


def test_a_reversal_under_the_contour_tolerance_is_a_halt() -> None:
    limits = TRAPEZOID.with_(corner_speed_difference_mm_min=math.inf, corner_deviation_mm=0.01)
    assert plan(line((50.0, 0.0, 0.0), (0.0, 0.0, 0.0)), limits).exit_mm_s[0] == pytest.approx(0.0, abs=1e-6)
    half = math.sin(math.pi / 4.0)
    square = plan(line((50.0, 0.0, 0.0), (50.0, 50.0, 0.0)), limits)
    assert square.exit_mm_s[0] == pytest.approx(math.sqrt(2500.0 * 0.01 * half / (1.0 - half)))


def test_an_arc_is_bound_by_its_centripetal_acceleration() -> None:
    turn = path_from_moves([canonical.Arc(0, (0.0, 0.0, 0.0), (0.1, 0.0, 0.0), 17, 20.0 * math.pi, 60000.0)])
    assert plan(turn, TRAPEZOID).peak_mm_s[0] == pytest.approx(math.sqrt(2500.0 * 0.1))
    assert plan(turn, TRAPEZOID.with_(centripetal_mm_s2=90.0)).peak_mm_s[0] == pytest.approx(3.0)


def test_a_rapid_goes_straight_at_the_rate_of_its_slowest_axis_and_halts() -> None:
    rapid = path_from_moves([canonical.Rapid(0, (300.0, 400.0, 0.0)), canonical.Linear(1, (301.0, 400.0, 0.0), 600.0)])
    planned = plan(rapid, LIMITS.with_(rapid_mm_min=(6000.0, 24000.0, 24000.0)))
    assert planned.peak_mm_s[0] == pytest.approx(100.0 / 0.6)
    assert planned.exit_mm_s[0] == 0.0


def test_rapids_overlap_where_the_control_lets_them() -> None:
    moves = [canonical.Rapid(0, (100.0, 0.0, 0.0)), canonical.Rapid(1, (200.0, 10.0, 0.0))]
    halting, flowing = (plan(path_from_moves(moves), LIMITS.with_(rapid_overlap=overlap)) for overlap in (False, True))
    assert halting.exit_mm_s[0] == 0.0
    assert flowing.exit_mm_s[0] > 0.0
    assert flowing.total_s < halting.total_s


def test_exact_stop_and_block_time_and_in_position_cost_what_they_say() -> None:
    ends = [(float(k), 0.0, 0.0) for k in range(1, 11)]
    through = plan(line(*ends), TRAPEZOID)
    stopping = [canonical.ExactStop(0, True), *(canonical.Linear(k, end, 3000.0) for k, end in enumerate(ends))]
    halted = plan(path_from_moves(stopping), TRAPEZOID.with_(in_position_s=0.03))
    assert halted.total_s == pytest.approx(10 * (1.0 / 50.0 + 50.0 / 2500.0 + 0.03))
    assert through.total_s == pytest.approx(10.0 / 50.0 + 50.0 / 2500.0)
    slow = plan(line(*ends), TRAPEZOID.with_(block_time_s=0.1))
    assert slow.peak_mm_s.max() == pytest.approx(10.0)


def test_overrides_scale_feed_and_rapid_apart() -> None:
    path = path_from_moves([canonical.Rapid(0, (600.0, 0.0, 0.0)), canonical.Linear(1, (700.0, 0.0, 0.0), 3000.0)])
    planned = plan(path, LIMITS, feed_override=0.5, rapid_override=np.array([0.25, 1.0]))
    assert planned.peak_mm_s == pytest.approx([150.0, 25.0])


def test_a_feed_of_nothing_is_refused_by_line() -> None:
    with pytest.raises(PartProgramError, match="line 1: F: the feed at segment 0"):
        plan(line((1.0, 0.0, 0.0), feed=0.0), LIMITS)


def test_limits_for_another_machine_are_refused() -> None:
    with pytest.raises(MachineError, match="2 axes"):
        plan(line((1.0, 0.0, 0.0)), LIMITS.with_(rapid_mm_min=(1000.0, 1000.0)))


def program() -> Path:
    return path_from_moves(
        [
            canonical.ToolChange(0, 3),
            canonical.Spindle(1, 6000.0, 1),
            canonical.Rapid(1, (60.0, 0.0, 0.0)),
            canonical.Linear(2, (70.0, 0.0, 0.0), 600.0),
            canonical.Dwell(3, 0.5),
            canonical.Spindle(4, 3000.0, -1),
            canonical.Linear(5, (80.0, 0.0, 0.0), 600.0),
            canonical.ToolChange(6, 4),
            canonical.ProgramEnd(7),
        ]
    )


def test_the_spindle_is_waited_for_where_cutting_begins() -> None:
    limits = TRAPEZOID.with_(tool_change_s=2.0, spindle_acceleration_rpm_s=3000.0)
    planned = plan(program(), limits)
    assert planned.start_s[0] == pytest.approx(2.0)  # the rapid goes while the spindle runs up
    assert planned.start_s[1] == pytest.approx(4.0)  # 6000 at 3000 a second
    reversing = planned.start_s[2] - planned.event_start_s[3]
    assert reversing == pytest.approx(3.0)  # from +6000 to −3000
    assert planned.event_duration_s[4] == pytest.approx(1.0 + 2.0)  # stops from 3000, then changes


def test_a_control_whose_m3_ends_with_the_speed_keeps_later_rapids_waiting() -> None:
    moves = [canonical.Spindle(0, 3000.0, 1), canonical.Rapid(0, (1.0, 0.0, 0.0)), canonical.Rapid(1, (2.0, 0.0, 0.0))]
    starts = [
        plan(path_from_moves(moves), LIMITS.with_(spindle_acceleration_rpm_s=3000.0, rapid_waits_for_spindle=waits)).start_s
        for waits in (False, True)
    ]
    assert [start[0] for start in starts] == [0.0, 0.0]
    assert starts[0][1] < 0.5
    assert starts[1][1] == pytest.approx(1.0)


def test_above_its_base_speed_a_spindle_accelerates_at_constant_power() -> None:
    moves = [canonical.Spindle(0, 4000.0, 1), canonical.Linear(1, (1.0, 0.0, 0.0), 600.0)]
    planned = plan(path_from_moves(moves), TRAPEZOID.with_(spindle_acceleration_rpm_s=1000.0, spindle_base_rpm=2000.0))
    assert planned.start_s[0] == pytest.approx(2.0 + (16.0 - 4.0) / 4.0)
    motion = sampled(planned, 0.01)
    at = np.searchsorted(motion.t_s, [1.0, 2.0, 3.25, 5.0])
    assert motion.spindle_rpm[at] == pytest.approx([1000.0, 2000.0, math.sqrt(4e6 + 5e6), 4000.0], rel=1e-3)


def test_seconds_by_line_add_up_to_the_total() -> None:
    planned = plan(program(), LIMITS.with_(tool_change_s=2.0, spindle_acceleration_rpm_s=3000.0, in_position_s=0.01))
    assert planned.seconds_by_line().sum() == pytest.approx(planned.total_s, abs=1e-9)


def test_machine_toml_gives_the_same_plan() -> None:
    toml = Program(rapid_mm_min=36000.0, acceleration_mm_s2=2500.0, jerk_mm_s3=60000.0, corner_speed_difference_mm_min=500.0)
    assert plan(program(), toml).total_s == plan(program(), LIMITS).total_s


STEP = st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-1.0, 1.0), st.floats(60.0, 12000.0))
TURN = st.tuples(st.floats(-math.pi, math.pi), st.floats(0.5, 20.0), st.floats(60.0, 12000.0))


def wandering(steps: list[tuple[float, ...]]) -> Path:
    """Lines (four figures) and arcs in the xy plane (three), one after the other."""
    here, moves = (0.0, 0.0, 0.0), []
    for k, step in enumerate(steps):
        if len(step) == 4:
            here = (here[0] + step[0], here[1] + step[1], here[2] + step[2])
            moves.append(canonical.Linear(k, here, step[3]))
        else:
            sweep, radius, feed = step
            centre = (here[0], here[1] - radius, here[2])
            here = (centre[0] - radius * math.sin(sweep), centre[1] + radius * math.cos(sweep), here[2])
            moves.append(canonical.Arc(k, here, centre, 17, sweep, feed))
    return path_from_moves(moves)


WANDERING = st.lists(st.one_of(STEP, TURN), min_size=1, max_size=12).map(wandering).filter(len)


@settings(deadline=None)
@given(path=WANDERING, jerk=st.sampled_from([math.inf, 60000.0, 3000.0]))
def test_no_plan_breaks_a_limit(path: Path, jerk: float) -> None:
    planned = plan(path, LIMITS.with_(jerk_mm_s3=jerk))
    assert np.all(planned.peak_mm_s <= path.feed_mm_min / 60.0 * (1.0 + 1e-9))
    bend = path.curvature_per_mm()
    assert np.all(planned.peak_mm_s**2 * bend <= 2500.0 * (1.0 + 1e-9))
    every = np.arange(len(path))
    jump = path.tangents(every, np.zeros(len(path)))[1:] - path.tangents(every, path.length_mm)[:-1]
    assert np.all(np.abs(jump) * planned.entry_mm_s[1:, None] <= 500.0 / 60.0 * (1.0 + 1e-6) + 1e-9)
    assert planned.entry_mm_s[1:] == pytest.approx(planned.exit_mm_s[:-1])
    motion = sampled(planned, 1e-3)
    along = np.diff(motion.feed_mm_min / 60.0) / 1e-3
    assert np.max(np.abs(along), initial=0.0) <= 2500.0 * math.sqrt(3.0) * (1.0 + 1e-6)  # all three axes at theirs


@settings(deadline=None)
@given(path=WANDERING, jerk=st.sampled_from([math.inf, 60000.0]))
def test_the_reference_is_continuous_and_exact_at_both_ends(path: Path, jerk: float) -> None:
    motion = sampled(plan(path, LIMITS.with_(jerk_mm_s3=jerk)), 1e-3)
    assert motion.reference_mm[0].tolist() == path.start_mm[0].tolist()
    assert motion.reference_mm[-1].tolist() == path.end_mm[-1].tolist()
    moved = np.linalg.norm(np.diff(motion.reference_mm, axis=0), axis=1)
    assert np.max(moved, initial=0.0) <= path.feed_mm_min.max() / 60.0 * 1e-3 * (1.0 + 1e-6)


@settings(deadline=None)
@given(path=WANDERING)
def test_an_endless_jerk_is_the_trapezoid(path: Path) -> None:
    endless = plan(path, LIMITS.with_(jerk_mm_s3=1e12)).total_s  # each of its ramps still takes a few nanoseconds
    assert endless == pytest.approx(plan(path, TRAPEZOID).total_s, rel=1e-3, abs=1e-8)


@settings(deadline=None)
@given(path=WANDERING)
def test_more_is_never_slower_for_the_trapezoid(path: Path) -> None:
    slow, fast = plan(path, TRAPEZOID.with_(acceleration_mm_s2=1000.0)), plan(path, TRAPEZOID)
    assert fast.total_s <= slow.total_s * (1.0 + 1e-12)


@settings(deadline=None)
@given(path=WANDERING, jerk=st.sampled_from([math.inf, 60000.0]), factors=st.lists(st.floats(0.2, 3.0), min_size=1, max_size=4))
def test_a_batch_of_feeds_takes_what_each_of_them_takes(path: Path, jerk: float, factors: list[float]) -> None:
    limits = LIMITS.with_(jerk_mm_s3=jerk)
    feeds = np.outer(factors, path.feed_mm_min)
    alone = [plan(path, limits, feed_override=factor).total_s for factor in factors]
    values = np.broadcast_to([event.value for event in path.events], (len(feeds), len(path.events)))
    assert Candidates.of(path, limits).seconds_and_wear(feeds, values)[0] == pytest.approx(alone, rel=1e-12)


def test_short_blocks_are_joined_where_their_corners_do_not_bind() -> None:
    smooth = plan(line(*[(0.5 * k, 0.0005 * k * k, 0.0) for k in range(1, 60)]), LIMITS)
    assert smooth.stretches.first[1] > 5  # the ramp up to the feed is one
    apart = plan(line((29.5, 0.0, 0.0)), LIMITS)
    assert smooth.total_s == pytest.approx(apart.total_s, rel=0.01)
    zigzag = line(*[(0.5 * k, 0.02 * (-1) ** k, 0.0) for k in range(1, 60)])
    assert len(plan(zigzag, LIMITS.with_(corner_speed_difference_mm_min=100.0)).stretches.seconds) == 59


def test_what_is_sampled_names_line_tool_spindle_and_state() -> None:
    planned = plan(program(), TRAPEZOID.with_(tool_change_s=2.0, spindle_acceleration_rpm_s=3000.0))
    motion = sampled(planned, 0.001)
    assert motion.line[[0, 1999, 2001, 4001]].tolist() == [0, 0, 1, 2]
    assert motion.tool_change_active[:2000].all()
    assert not motion.tool_change_active[2000]
    assert motion.tool_number[[0, 2500]].tolist() == [0, 3]
    assert motion.spindle_rpm[3000] == pytest.approx(3000.0)
    assert set(motion.spindle_direction.tolist()) == {-1, 0, 1}
    assert motion.exec_state[[0, -1]].tolist() == [ExecState.ACTIVE, ExecState.PROGRAM_COMPLETED]
    assert motion.tool_number[-1] == 4
    columns = program_columns(motion)
    assert {len(column) for column in columns.values()} == {len(motion)}
    assert columns["exec_state"][[0, -1]].tolist() == ["ACTIVE", "PROGRAM_COMPLETED"]


def test_averages_after_interpolation_round_the_corner_and_meet_the_end() -> None:
    planned = plan(line((20.0, 0.0, 0.0), (20.0, 20.0, 0.0)), LIMITS.with_(corner_speed_difference_mm_min=math.inf))
    sharp, round_ = sampled(planned, 0.001), sampled(planned, 0.001, (0.064, 0.024))
    assert len(round_) == len(sharp) + 63 + 23
    assert round_.reference_mm[-1].tolist() == [20.0, 20.0, 0.0]
    corner = np.min(np.linalg.norm(round_.reference_mm - [20.0, 0.0, 0.0], axis=1))
    assert 0.01 < corner < 2.0


def test_a_program_that_does_not_move_has_a_plan() -> None:
    planned = plan(path_from_moves([canonical.Dwell(0, 1.5)]), LIMITS)
    motion = sampled(planned, 0.1)
    assert planned.total_s == 1.5
    assert motion.t_s[-1] == pytest.approx(1.5)
    assert not motion.reference_mm.any()
