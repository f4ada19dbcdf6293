"""Turning cools."""

import pytest

from twin.effects.speed_convection import cooling_w_per_k
from twin.heat.run import Warming, spindle_temperature_c

THERMAL = {"alpha_w_per_pct_rpm2": 0.0, "beta_w_per_rpm": 0.02, "resistance_k_per_w": 0.2, "heat_capacity_j_per_k": 5000.0}
VALUES = {"speed_convection__gain": 0.6, "speed_convection__exponent": 0.5}


@pytest.mark.parametrize(("rpm", "expected"), [(0.0, 5.0), (1250.0, 6.5), (-1250.0, 6.5), (5000.0, 8.0)])
def test_the_cooling_grows_with_a_power_of_the_speed(rpm: float, expected: float) -> None:
    """5 W/K at rest; a quarter of 5,000 rev/min to the power 0.5 is a half of the gain."""
    assert cooling_w_per_k(5.0, rpm, 0.6, 0.5) == pytest.approx(expected)


def test_it_settles_lower() -> None:
    """100 W at 5,000 rev/min behind 8 W/K: 12.5 K in place of 20 K."""
    end = spindle_temperature_c(THERMAL | VALUES, Warming([0.0, 1e6], 0.0, 5000.0, 20.0), 20.0, effects=["speed_convection"])
    assert end[0, -1] == pytest.approx(32.5)
