"""The thermal network against its closed form."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.thermal import ThermalNetwork, heat_input_w, rise_after

VMC = ThermalNetwork(2.2e-8, 1.6e-2, 0.12, 9000.0)
seconds = st.floats(0.0, 1e5)
watts = st.floats(0.0, 1e4)
kelvins = st.floats(-50.0, 200.0)


def test_after_one_time_constant_63_2_percent_of_the_rise_is_there() -> None:
    assert rise_after(VMC, 0.0, 100.0, VMC.time_constant_s) == pytest.approx(100.0 * 0.12 * (1 - math.exp(-1)))


def test_the_steady_state_is_heat_times_resistance() -> None:
    assert rise_after(VMC, 3.0, 250.0, 1e6) == pytest.approx(30.0)


def test_without_heat_the_rise_halves_every_ln2_time_constants() -> None:
    assert rise_after(VMC, 8.0, 0.0, math.log(2) * VMC.time_constant_s) == pytest.approx(4.0)


@given(kelvins, watts, seconds, seconds)
def test_two_steps_are_one_step(rise: float, heat: float, first: float, second: float) -> None:
    at_once = rise_after(VMC, rise, heat, first + second)
    in_two = rise_after(VMC, rise_after(VMC, rise, heat, first), heat, second)
    assert in_two == pytest.approx(at_once, abs=1e-9, rel=1e-9)


@given(kelvins, watts)
def test_no_time_changes_nothing_but_the_last_bit(rise: float, heat: float) -> None:
    assert rise_after(VMC, rise, heat, 0.0) == pytest.approx(rise, abs=1e-9)


@given(kelvins, watts, st.floats(1e-3, 1e4))
def test_the_rise_moves_towards_the_steady_state_and_never_past_it(rise: float, heat: float, duration: float) -> None:
    final = heat * VMC.resistance_k_per_w
    after = rise_after(VMC, rise, heat, duration)
    assert min(rise, final) - 1e-9 <= after <= max(rise, final) + 1e-9


def test_small_euler_steps_approach_the_exact_one() -> None:
    rise, step_s = 0.0, 0.01
    for _ in range(60_000):
        rise += step_s * (200.0 - rise / VMC.resistance_k_per_w) / VMC.capacity_j_per_k
    assert rise_after(VMC, 0.0, 200.0, 600.0) == pytest.approx(rise, abs=1e-4)


def test_heat_ignores_the_sense_of_rotation_and_braking() -> None:
    assert heat_input_w(VMC, -4000.0, 30.0) == heat_input_w(VMC, 4000.0, 30.0)
    assert heat_input_w(VMC, 4000.0, -20.0) == heat_input_w(VMC, 4000.0, 0.0) == pytest.approx(64.0)


@pytest.mark.parametrize(
    ("constants", "culprit"),
    [
        ((-1.0, 0.0, 0.1, 1.0), "alpha_w_per_pct_rpm2"),
        ((0.0, math.nan, 0.1, 1.0), "beta_w_per_rpm"),
        ((0.0, 0.0, 0.0, 1.0), "resistance_k_per_w"),
        ((0.0, 0.0, 0.1, math.inf), "capacity_j_per_k"),
    ],
)
def test_a_meaningless_constant_is_refused_by_name(constants: tuple[float, float, float, float], culprit: str) -> None:
    with pytest.raises(ValueError, match=culprit):
        ThermalNetwork(*constants)


def test_time_does_not_run_backwards() -> None:
    with pytest.raises(ValueError, match="duration_s"):
        rise_after(VMC, 1.0, 1.0, -0.1)
