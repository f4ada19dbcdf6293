"""The axis of the reference machine against mechanics that can be worked out by hand."""

import numpy as np
import pytest

from cnctwin.standins.reference_machine import axis
from cnctwin.standins.reference_machine.axis import AxisPhysics

NOMINAL = AxisPhysics(320.0, 628.3, 12.0, 40.0, 0.3, 9.0, 60.0, 380.0, 520.0, 6.0, 2.4)
TICKS = 1500


def ran(physics: AxisPhysics, reference: np.ndarray, force_n: float | np.ndarray = 0.0) -> np.ndarray:
    out = np.empty((3, len(reference)))
    force = np.broadcast_to(force_n, (len(reference) * axis.STEPS,)).copy()
    velocity = np.gradient(reference, 0.001)
    axis.run(physics, reference, velocity, np.gradient(velocity, 0.001), force, 0, out)
    return out


def ramp(speed_mm_s: float) -> np.ndarray:
    return np.maximum(np.arange(TICKS) - 100.0, 0.0) * 0.001 * speed_mm_s


def test_an_axis_at_rest_stays_there() -> None:
    motor, torque, table = ran(NOMINAL, np.zeros(TICKS))
    assert not motor.any() and not torque.any() and not table.any()


def test_a_push_below_the_breakaway_force_moves_nothing() -> None:
    motor, torque, _ = ran(NOMINAL, np.zeros(50), 519.0)
    assert not motor.any() and not torque.any()
    assert ran(NOMINAL, np.zeros(50), 521.0)[0][-1] > 0.0


@pytest.mark.parametrize("speed", [5.0, 20.0, 100.0, -100.0])
def test_constant_speed_takes_friction_and_leaves_speed_over_gain(speed: float) -> None:
    reference = ramp(speed)
    motor, torque, _ = ran(NOMINAL, reference)
    dry = 380.0 + 140.0 * np.exp(-((speed / 6.0) ** 2))
    assert torque[-1] * 628.3 == pytest.approx(np.sign(speed) * dry + 2.4 * speed, rel=2e-3)
    assert reference[-1] - motor[-1] == pytest.approx(speed / 40.0, rel=2e-3)


def test_gravity_is_held_at_rest_by_its_torque() -> None:
    _, torque, _ = ran(NOMINAL._replace(gravity_n=2000.0), np.zeros(8000))
    assert abs(torque[-1] * 628.3 - 2000.0) <= 520.0


def test_a_table_with_play_trails_by_half_of_it_either_way() -> None:
    motor, _, table = ran(NOMINAL._replace(play_mm=0.02), np.concatenate([ramp(20.0), ramp(20.0)[::-1]]))
    assert motor[TICKS - 1] - table[TICKS - 1] == pytest.approx(0.01, abs=1e-9)
    assert motor[-200] - table[-200] == pytest.approx(-0.01, abs=1e-9)


def test_a_bristle_bends_as_its_law_says() -> None:
    """x = −F_s/σ ln(1 − F/F_s) under a force that grows slowly: it slides a little, whatever the force."""
    soft = NOMINAL._replace(bristle_n_per_mm=2e4, position_gain=0.0, velocity_gain=0.0, integral_gain=0.0)
    motor, _, _ = ran(soft, np.zeros(2000), np.linspace(0.0, 260.0, 2000 * axis.STEPS))
    assert motor[-1] == pytest.approx(-520.0 / 2e4 * np.log(0.5), rel=0.03)


def test_twice_as_many_forces_make_twice_the_acceleration() -> None:
    free = NOMINAL._replace(coulomb_n=0.0, static_n=0.0, viscous=0.0, position_gain=0.0, velocity_gain=0.0, integral_gain=0.0)
    one, two = (ran(free, np.zeros(100), force)[0][-1] for force in (320.0, 640.0))
    assert one == pytest.approx(0.5 * 1000.0 * 0.099**2, rel=1e-9)
    assert two == pytest.approx(2.0 * one, rel=1e-12)


def test_torque_and_integral_stay_within_the_limit() -> None:
    _, torque, _ = ran(NOMINAL._replace(limit_a=1.0), ramp(150.0))
    assert np.abs(torque).max() == 1.0


@pytest.mark.parametrize("speed", [20.0, -100.0])
def test_compensated_friction_is_there_at_once_and_changes_nothing_later(speed: float) -> None:
    reference = ramp(speed)
    plain, compensated = (ran(NOMINAL._replace(compensation_a=a), reference) for a in (0.0, 0.4))
    assert compensated[1][-1] == pytest.approx(plain[1][-1], rel=1e-3), "the torque is what friction takes"
    assert (compensated[1] - plain[1])[100] == pytest.approx(np.sign(speed) * 0.4), "it is there as soon as the reference moves"


def test_a_filtered_reference_trails_by_its_time_constant() -> None:
    reference = ramp(50.0)
    motor, _, _ = ran(NOMINAL._replace(filter_s=0.01), reference)
    assert reference[-1] - motor[-1] == pytest.approx(50.0 / 40.0 + 50.0 * 0.01, rel=0.02)


def test_an_integral_of_the_position_leaves_no_error_at_constant_speed() -> None:
    long = np.maximum(np.arange(3 * TICKS) - 100.0, 0.0) * 0.02
    motor, _, _ = ran(NOMINAL._replace(outer_per_s=8.0), long)
    assert long[-1] - motor[-1] == pytest.approx(0.0, abs=1e-3)
    plain, _, _ = ran(NOMINAL, long)
    assert long[-1] - plain[-1] == pytest.approx(20.0 / 40.0, rel=1e-3)
