"""A second thermal mass: limits that can be worked out by hand, and an independent integration."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from twin.heat.run import Warming, spindle_temperature_c

THERMAL = {"alpha_w_per_pct_rpm2": 0.0, "beta_w_per_rpm": 0.02, "resistance_k_per_w": 0.2, "heat_capacity_j_per_k": 5000.0}


def warmed(conductance: float, capacity: float, seconds: float, rpm: float = 5000.0, start_c: float = 20.0) -> float:
    values = {
        "second_thermal_mass__conductance_w_per_k": conductance,
        "second_thermal_mass__capacity_j_per_k": capacity,
    }
    warming = Warming([0.0, seconds], 0.0, rpm, 20.0)
    return float(spindle_temperature_c(THERMAL | values, warming, start_c, effects=["second_thermal_mass"])[0, -1])


def test_two_masses_that_are_joined_tightly_are_one() -> None:
    """5,000 + 15,000 J/K behind 0.2 K/W: after 4,000 s, 63.2 % of 20 K."""
    assert warmed(1000.0, 15000.0, 4000.0) == pytest.approx(20.0 + 20.0 * (1.0 - np.exp(-1.0)), abs=0.01)


def test_a_column_that_never_warms_is_a_second_way_out() -> None:
    """5 W/K to the air and 5 W/K into a column without end: 100 W make 10 K."""
    assert warmed(5.0, 1e7, 5000.0) == pytest.approx(30.0, abs=0.05)


def test_in_the_end_the_column_takes_no_heat() -> None:
    assert warmed(4.0, 40000.0, 1e7) == pytest.approx(40.0)


def test_the_step_is_that_of_an_integration_of_the_two_equations() -> None:
    def slopes(_t: float, y: np.ndarray) -> list[float]:
        flow = 4.0 * (y[0] - y[1])
        return [(100.0 - 5.0 * (y[0] - 20.0) - flow) / 5000.0, flow / 40000.0]

    expected = solve_ivp(slopes, (0.0, 3000.0), [26.0, 26.0], rtol=1e-10, atol=1e-10).y[0, -1]
    assert warmed(4.0, 40000.0, 3000.0, start_c=26.0) == pytest.approx(expected, abs=1e-7)
