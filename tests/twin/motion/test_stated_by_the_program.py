"""Contour tolerance, jerk limit and exact stop that a program states, in the plan of its speed."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.motion.limits import Limits, bounds
from twin.motion.path import path_from_moves
from twin.motion.plan import Plan, plan
from twin.programs.canonical import ExactStop, FeedForward, JerkLimit, Linear, Move, Tolerance

LIMITS = Limits(rapid_mm_min=30_000.0, acceleration_mm_s2=1000.0, jerk_mm_s3=20_000.0, corner_speed_difference_mm_min=300.0)
FEED_MM_MIN = 30_000.0


def corner(turn_deg: float, *before: Move) -> list[Move]:
    """Two lines of 1 m that meet with that change of direction."""
    turn = math.radians(turn_deg)
    end = (1000.0 + 1000.0 * math.cos(turn), 1000.0 * math.sin(turn), 0.0)
    return [*before, Linear(0, (1000.0, 0.0, 0.0), FEED_MM_MIN), Linear(1, end, FEED_MM_MIN)]


def planned(moves: list[Move], limits: Limits = LIMITS) -> Plan:
    return plan(path_from_moves(moves), limits)


def speed_at_corner(moves: list[Move], limits: Limits = LIMITS) -> float:
    return float(planned(moves, limits).exit_mm_s[0])


def test_a_right_angle_is_passed_on_the_circle_that_leaves_it_by_the_tolerance() -> None:
    radius_mm = 0.1 * math.sqrt(0.5) / (1.0 - math.sqrt(0.5))
    assert speed_at_corner(corner(90.0, Tolerance(0, 0.1))) == pytest.approx(math.sqrt(1000.0 * radius_mm), rel=1e-12)


def test_the_tolerance_of_the_program_stands_in_place_of_the_machines_corner_rule() -> None:
    assert speed_at_corner(corner(90.0)) == pytest.approx(5.0)
    assert speed_at_corner(corner(90.0, Tolerance(0, 0.001))) < 5.0 < speed_at_corner(corner(90.0, Tolerance(0, 0.1)))


def test_a_machine_that_plans_by_tolerance_and_a_program_that_states_the_same_one_agree() -> None:
    by_machine = LIMITS.with_(corner_speed_difference_mm_min=np.inf, corner_deviation_mm=0.02)
    assert speed_at_corner(corner(60.0), by_machine) == speed_at_corner(corner(60.0, Tolerance(0, 0.02)))


def test_none_is_back_to_the_machines_own() -> None:
    cancelled = corner(90.0, Tolerance(0, 0.1), Tolerance(0, None))
    assert planned(cancelled).total_s == planned(corner(90.0)).total_s


def test_where_a_tolerance_begins_at_a_corner_it_holds_there() -> None:
    first, second = corner(90.0)
    assert speed_at_corner([first, Tolerance(1, 0.1), second]) == speed_at_corner(corner(90.0, Tolerance(0, 0.1)))
    assert speed_at_corner([Tolerance(0, 0.1), first, Tolerance(1, 0.01), second]) == speed_at_corner(
        corner(90.0, Tolerance(0, 0.01))
    )


def test_an_exact_stop_is_a_halt_whatever_the_tolerance() -> None:
    assert speed_at_corner(corner(90.0, Tolerance(0, 0.1), ExactStop(0, True))) == 0.0


@settings(max_examples=30)
@given(st.floats(1.0, 179.0), st.floats(1e-4, 1.0), st.floats(1.0, 10.0))
def test_a_wider_tolerance_is_never_slower(turn_deg: float, tolerance_mm: float, factor: float) -> None:
    tight, wide = (planned(corner(turn_deg, Tolerance(0, t))).total_s for t in (tolerance_mm, tolerance_mm * factor))
    assert wide <= tight * (1.0 + 1e-12)


def test_without_its_jerk_limit_a_line_is_the_trapezoid() -> None:
    free = LIMITS.with_(jerk_mm_s3=np.inf)
    assert planned(corner(0.0, JerkLimit(0, False))).total_s == planned(corner(0.0), free).total_s
    assert planned(corner(0.0, JerkLimit(0, False), JerkLimit(0, True))).total_s == planned(corner(0.0)).total_s


def test_the_jerk_limit_is_off_from_its_line_on() -> None:
    first, second = corner(90.0)
    jerk = bounds(path_from_moves([first, JerkLimit(1, False), second]), LIMITS).jerk_mm_s3
    assert jerk.tolist() == [20_000.0, np.inf]


def test_feed_forward_changes_no_plan() -> None:
    assert planned(corner(90.0, FeedForward(0, True))).total_s == planned(corner(90.0)).total_s
