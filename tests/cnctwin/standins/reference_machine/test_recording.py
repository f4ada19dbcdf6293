"""What the reference machine records: its sensors, its clock, its meters, its heat, its effects."""

import numpy as np
import pytest

from cnctwin.standins.reference_machine import heat, spindle
from cnctwin.standins.reference_machine.effect import Effect
from cnctwin.standins.reference_machine.heat import HeatPhysics
from cnctwin.standins.reference_machine.named_effects import AXIS_EFFECTS, NAMED
from cnctwin.standins.reference_machine.physics import Physics, physics_of
from cnctwin.standins.reference_machine.recording import Columns, Motion, motion_of, motion_run
from cnctwin.standins.reference_machine.spindle import MeterPhysics
from cnctwin.standins.reference_machine.stated import drawn_machine
from cnctwin.standins.reference_machine.trajectory import Dwell, Dynamics, Line
from cnctwin.standins.reference_machine.unnamed_effects import UNNAMED

STRAIGHT = (Dwell(0.2, 6000.0), Line((40.0, 30.0, -20.0), 4000.0), Dwell(0.3), Line((0.0, 0.0, 0.0), 9000.0), Dwell(1.2))
SLOT = (Dwell(0.4, 3000.0), Line((60.0, None, None), 2400.0, 2.0, (0.0, np.pi)), Dwell(0.3))


@pytest.fixture(scope="module")
def physics() -> Physics:
    return physics_of(drawn_machine(np.random.default_rng(4)))


@pytest.fixture(scope="module")
def air() -> Motion:
    return motion_of(STRAIGHT, Dynamics(2400.0, 0.04), np.random.default_rng(1))


@pytest.fixture(scope="module")
def cut() -> Motion:
    return motion_of(SLOT, Dynamics(2400.0, 0.04), np.random.default_rng(1))


def differs(one: Columns, other: Columns) -> set[str]:
    return {name for name in one if not np.array_equal(one[name], other[name], equal_nan=True)}


def test_the_same_seed_records_the_same_and_another_does_not(physics: Physics, air: Motion) -> None:
    one = motion_run(physics, air, 1)
    assert not differs(one, motion_run(physics, air, 1))
    changed = differs(one, motion_run(physics, air, 2))
    assert {"x_pos_mm", "z_torque_a"} <= changed and not {"x_ref_mm", "t_s", "line"} & changed


def test_readings_have_the_noise_of_their_sensors_at_rest(physics: Physics, air: Motion) -> None:
    run = motion_run(physics, air, 1)
    still = run["x_pos_mm"][:200].astype(np.float64)
    assert still.std() == pytest.approx(physics.noise.position_mm, rel=0.2)
    assert run["x_pos_mm"].dtype == np.float32


@pytest.mark.parametrize("effect", AXIS_EFFECTS, ids=lambda effect: effect.name)
def test_an_effect_on_an_axis_shows_on_that_axis_only(effect: Effect, physics: Physics, air: Motion) -> None:
    amplitude = min(effect.most, 5.0)
    changed = effect.acts(physics, "y", effect.parameters(amplitude, effect.traits(np.random.default_rng(2))))
    shown = differs(motion_run(physics, air, 1), motion_run(changed, air, 1))
    assert shown and {name[:2] for name in shown} == {"y_"}


@pytest.mark.parametrize(
    "effect", [e for e in (*NAMED, *UNNAMED) if "cut" in e.kinds and e.places == ("",)], ids=lambda e: e.name
)
def test_an_effect_of_the_cut_or_the_meter_shows_in_a_cut(effect: Effect, physics: Physics, cut: Motion) -> None:
    changed = effect.acts(physics, "", effect.parameters(1.0, effect.traits(np.random.default_rng(2))))
    shown = differs(motion_run(physics, cut, 1), motion_run(changed, cut, 1))
    assert {"force_x_n", "spindle_load_pct"} & shown


def test_load_is_electrical_power_over_rated_power() -> None:
    load = spindle.load_pct(MeterPhysics(11.0, 0.85, 0.25), np.full(300, 1700.0), np.full(300, 3000.0))
    assert load[-1] == pytest.approx(100.0 * (2.0 + 0.25) / 11.0)


def test_a_held_peak_falls_by_63_percent_in_its_time() -> None:
    power = np.where(np.arange(4000) < 1500, 8500.0, 0.0)
    load = spindle.load_pct(MeterPhysics(10.0, 0.85, 0.0, hold_s=0.5), power, np.full(4000, 3000.0))
    assert load[2100] / load[1600] == pytest.approx(np.exp(-1.0), rel=0.02)


def test_heat_settles_where_what_comes_in_goes_off() -> None:
    count = 20000
    p = HeatPhysics(0.0, 0.016, 1.0 / 0.12, 9000.0)
    shown = heat.temperature_c(p, 1.0, 20.0, np.zeros(count), np.full(count, 6250.0), np.full(count, 20.0), np.zeros(count))
    assert shown[-1] - 20.0 == pytest.approx(100.0 * 0.12, rel=1e-6)
    assert shown[1080] - 20.0 == pytest.approx(12.0 * (1.0 - np.exp(-1.0)), rel=1e-6)
