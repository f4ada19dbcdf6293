"""Single profiles against ruckig, and the laws that every profile keeps."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruckig import InputParameter, Ruckig, Trajectory

from twin.motion.s_curve import (
    along_profile,
    peak_speed,
    profile_time,
    ramp_distance,
    ramp_time,
    reachable_speed,
    time_at_distance,
)

SPEED = st.floats(0.0, 500.0)
LIMIT = st.floats(10.0, 20_000.0)
JERK = st.one_of(st.floats(100.0, 1e6), st.just(math.inf))
DISTANCE = st.floats(1e-3, 2000.0)


def by_ruckig(v0: float, v1: float, cap: float, distance: float, a: float, j: float) -> Trajectory:
    """The fastest profile by ruckig 0.19."""
    asked = InputParameter(1)
    asked.current_position, asked.current_velocity, asked.current_acceleration = [0.0], [v0], [0.0]
    asked.target_position, asked.target_velocity, asked.target_acceleration = [distance], [v1], [0.0]
    asked.max_velocity, asked.max_acceleration, asked.max_jerk = [cap], [a], [j]
    found = Trajectory(1)
    Ruckig(1).calculate(asked, found)
    return found


CASES = [
    (0.0, 0.0, 100.0, 200.0, 1000.0, 10_000.0),  # acceleration and cap are reached
    (0.0, 0.0, 100.0, 5.0, 1000.0, 10_000.0),  # neither is
    (0.0, 0.0, 100.0, 14.0, 1000.0, 60_000.0),  # acceleration is, the cap is not
    (0.0, 0.0, 5.0, 3.0, 1000.0, 10_000.0),  # the cap is, acceleration is not
    (10.0, 40.0, 100.0, 30.0, 1000.0, 10_000.0),
    (40.0, 10.0, 100.0, 12.0, 1000.0, 10_000.0),
    (5.0, 90.0, 100.0, 9.0, 1000.0, 80_000.0),
    (99.0, 0.0, 100.0, 50.0, 300.0, 2000.0),
    (20.0, 20.0, 35.0, 300.0, 50.0, 100.0),
]


@pytest.mark.parametrize(("v0", "v1", "cap", "distance", "a", "j"), CASES)
def test_duration_and_profile_are_those_of_ruckig(v0: float, v1: float, cap: float, distance: float, a: float, j: float) -> None:
    oracle = by_ruckig(v0, v1, cap, distance, a, j)
    peak = peak_speed(v0, v1, cap, distance, a, j)
    assert profile_time(v0, peak, v1, distance, a, j) == pytest.approx(oracle.duration, abs=1e-9)
    for t in np.linspace(0.0, oracle.duration, 57):
        s, v, acceleration = along_profile(float(t), v0, peak, v1, distance, a, j)
        theirs = [x[0] for x in oracle.at_time(float(t))]
        assert (s, v) == pytest.approx(tuple(theirs[:2]), abs=1e-7)
        assert acceleration == pytest.approx(theirs[2], abs=1e-3 * a)


@given(v0=SPEED, v1=SPEED, extra=st.floats(0.0, 100.0), slack=st.floats(1.001, 5.0), a=LIMIT, j=st.floats(100.0, 1e6))
def test_any_feasible_profile_is_as_fast_as_that_of_ruckig(
    v0: float, v1: float, extra: float, slack: float, a: float, j: float
) -> None:
    cap = max(v0, v1) + extra + 1.0
    distance = slack * ramp_distance(v0, v1, a, j) + 1e-2
    ours = profile_time(v0, peak_speed(v0, v1, cap, distance, a, j), v1, distance, a, j)
    assert ours == pytest.approx(by_ruckig(v0, v1, cap, distance, a, j).duration, rel=1e-7, abs=1e-8)


@given(v0=SPEED, distance=DISTANCE, a=LIMIT, j=JERK)
def test_the_reachable_speed_uses_the_distance_up(v0: float, distance: float, a: float, j: float) -> None:
    v1 = reachable_speed(v0, distance, a, j)
    assert v1 >= v0
    if v1 - v0 > 1e-6:
        assert ramp_distance(v0, v1, a, j) == pytest.approx(distance, rel=1e-6)


@given(v0=SPEED, v1=SPEED, extra=st.floats(0.0, 100.0), slack=st.floats(1.0, 5.0), a=LIMIT, j=JERK)
def test_no_profile_breaks_a_limit_and_each_arrives(v0: float, v1: float, extra: float, slack: float, a: float, j: float) -> None:
    cap, distance = max(v0, v1, 1.0) + extra, slack * ramp_distance(v0, v1, a, j) + 1e-3
    peak = peak_speed(v0, v1, cap, distance, a, j)
    total = profile_time(v0, peak, v1, distance, a, j)
    times = np.linspace(0.0, total, 301)
    s, v, acceleration = np.array([along_profile(float(t), v0, peak, v1, distance, a, j) for t in times]).T
    assert s[0] == 0.0
    assert s[-1] == pytest.approx(distance, abs=1e-9 * max(1.0, distance))
    assert np.all(np.diff(s) >= -1e-9 * max(1.0, distance))
    assert np.max(v) <= cap * (1.0 + 1e-12)
    assert np.max(np.abs(acceleration)) <= a * (1.0 + 1e-9)
    assert np.max(np.abs(np.diff(v))) <= a * total / 300.0 * (1.0 + 1e-6) + 1e-7
    if math.isfinite(j):
        assert np.max(np.abs(np.diff(acceleration))) <= j * total / 300.0 * (1.0 + 1e-6) + 1e-6 * a


@given(share=st.floats(0.0, 1.0), case=st.sampled_from(CASES))
def test_the_time_at_a_distance_is_the_inverse(share: float, case: tuple[float, ...]) -> None:
    v0, v1, cap, distance, a, j = case
    peak = peak_speed(v0, v1, cap, distance, a, j)
    t = time_at_distance(share * distance, v0, peak, v1, distance, a, j)
    assert along_profile(t, v0, peak, v1, distance, a, j)[0] == pytest.approx(share * distance, abs=1e-9)


def test_a_ramp_by_hand() -> None:
    assert ramp_time(0.0, 10.0, 100.0, 1000.0) == pytest.approx(0.2)  # 10/100 + 100/1000
    assert ramp_time(0.0, 10.0, 100.0, math.inf) == pytest.approx(0.1)
    assert ramp_distance(0.0, 10.0, 100.0, 1000.0) == pytest.approx(1.0)
