"""Points of the friction curve, and the curve through them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.identification.axis_fit import AxisRecording
from twin.identification.friction_points import FrictionPoint, fit_friction_curve, friction_points
from twin.machine import Axis, Friction
from twin.servo.constants import axis_constants
from twin.servo.run import AxisInput, run_axes

FRICTION = Friction(coulomb_n=(360.0, 400.0), static_n=(500.0, 540.0), stribeck_velocity_mm_s=6.0, viscous_n_s_per_mm=(2.2, 2.6))
AXIS = Axis(
    mass_kg=320.0,
    screw_lead_mm=12.0,
    torque_constant_nm_per_a=1.2,
    position_gain_per_s=40.0,
    velocity_gain_a_s_per_mm=0.3,
    velocity_integral_gain_a_per_mm=9.0,
    torque_limit_a=60.0,
    friction=FRICTION,
)
SPEEDS = (2.0, 4.0, 8.0, 15.0, 40.0, 100.0)


def friction_n(speed_mm_s: float) -> float:
    """Signed, from the law as formats states it."""
    side = int(speed_mm_s > 0)
    coulomb, static, viscous = ((360.0, 500.0, 2.2), (400.0, 540.0, 2.6))[side]
    size = coulomb + (static - coulomb) * np.exp(-((speed_mm_s / 6.0) ** 2)) + viscous * abs(speed_mm_s)
    return float(np.sign(speed_mm_s) * size)


def run_at(speeds: tuple[float, ...], axis: Axis = AXIS) -> AxisRecording:
    """There and back at each speed for a second each, with ramps and rests between them."""
    parts = [np.zeros(300)]
    for speed in speeds:
        for sign in (1.0, -1.0):
            ramp = np.linspace(0.0, sign * speed, 100)
            parts += [ramp, np.full(1000, sign * speed), ramp[::-1], np.zeros(200)]
    reference = 0.001 * np.cumsum(np.concatenate(parts))
    constants = {name: np.array([value]) for name, value in axis_constants(axis).items()}
    run = run_axes(constants, AxisInput(reference[None, :], np.zeros(1, dtype=np.intp)))
    t_s = 0.001 * np.arange(len(reference))
    position, torque = run.outputs["position_mm"][0], run.outputs["torque_a"][0]
    return AxisRecording(t_s, reference, position, torque, None, np.ones((2, len(t_s))))


@pytest.fixture(scope="module")
def points() -> tuple[FrictionPoint, ...]:
    return friction_points(run_at(SPEEDS), AXIS)


def test_each_stretch_of_constant_speed_is_a_point_on_the_friction_law(points: tuple[FrictionPoint, ...]) -> None:
    assert sorted(round(point.speed_mm_s, 3) for point in points) == sorted([*SPEEDS, *(-s for s in SPEEDS)])
    for point in points:
        assert point.force_n == pytest.approx(friction_n(point.speed_mm_s), abs=1.5)
        assert point.samples > 700


def test_the_curve_of_each_direction_is_found_again(points: tuple[FrictionPoint, ...]) -> None:
    for sign, coulomb, static, viscous in ((-1.0, 360.0, 500.0, 2.2), (1.0, 400.0, 540.0, 2.6)):
        there = [point for point in points if point.speed_mm_s * sign > 0.0]
        curve, _ = fit_friction_curve(np.abs([p.speed_mm_s for p in there]), np.abs([p.force_n for p in there]))
        assert curve.coulomb_n == pytest.approx(coulomb, rel=0.005)
        assert curve.static_n == pytest.approx(static, rel=0.02)
        assert curve.viscous_n_s_per_mm == pytest.approx(viscous, rel=0.01)


def test_a_run_that_only_accelerates_or_rests_has_no_points() -> None:
    still = run_at(())
    assert friction_points(still, AXIS) == ()
    t_s = 0.001 * np.arange(3000)
    swinging = AxisRecording(t_s, np.sin(6.0 * t_s) * 20.0, np.sin(6.0 * t_s) * 20.0, np.ones(3000), None, np.ones((2, 3000)))
    assert friction_points(swinging, AXIS) == ()


def test_a_stretch_with_a_missing_torque_is_left_out() -> None:
    run = run_at((40.0,))
    run.torque_a[900] = np.nan
    assert {round(point.speed_mm_s) for point in friction_points(run, AXIS)} == {-40}


@settings(max_examples=25, deadline=None)
@given(
    coulomb=st.floats(50.0, 1000.0),
    more=st.floats(0.0, 500.0),
    stribeck=st.floats(1.5, 40.0),
    viscous=st.floats(0.0, 5.0),
)
def test_no_curve_through_exact_points_leaves_anything_and_none_falls_with_negative_constants(
    coulomb: float, more: float, stribeck: float, viscous: float
) -> None:
    speed = np.geomspace(1.0, 150.0, 12)
    force = coulomb + more * np.exp(-((speed / stribeck) ** 2)) + viscous * speed
    curve, _ = fit_friction_curve(speed, force)
    again = curve.coulomb_n + (curve.static_n - curve.coulomb_n) * np.exp(-((speed / curve.stribeck_velocity_mm_s) ** 2))
    assert np.abs(again + curve.viscous_n_s_per_mm * speed - force).max() < 0.01 + 1e-4 * more
    assert min(curve.coulomb_n, curve.static_n - curve.coulomb_n, curve.viscous_n_s_per_mm) >= 0.0


def test_static_friction_below_the_slowest_speed_is_not_made_up() -> None:
    speed = np.array([20.0, 40.0, 60.0, 80.0, 100.0])
    noise = np.array([3.0, -1.0, 0.5, -0.5, 0.2])
    curve, _ = fit_friction_curve(speed, 400.0 + 2.0 * speed + noise)
    assert curve.static_n < 450.0
