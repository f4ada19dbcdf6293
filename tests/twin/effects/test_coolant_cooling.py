"""Coolant cools while it is on."""

import numpy as np
import pytest

from twin.heat.run import Warming, spindle_temperature_c

THERMAL = {"alpha_w_per_pct_rpm2": 0.0, "beta_w_per_rpm": 0.02, "resistance_k_per_w": 0.2, "heat_capacity_j_per_k": 5000.0}
GAIN = {"coolant_cooling__gain": 0.25}


def test_with_coolant_it_settles_lower_and_without_it_does_not_matter() -> None:
    """100 W behind 5 W/K are 20 K; behind 6.25 W/K, 16 K."""
    warming = Warming([0.0, 1e6, 2e6, 3e6], 0.0, 5000.0, 20.0, [0.0, 1.0, 0.0, 0.0])
    bare = spindle_temperature_c(THERMAL, warming, 20.0)
    cooled = spindle_temperature_c(THERMAL | GAIN, warming, 20.0, effects=["coolant_cooling"])
    assert bare[0] == pytest.approx([20.0, 40.0, 40.0, 40.0])
    assert cooled[0] == pytest.approx([20.0, 40.0, 36.0, 40.0])


def test_the_time_constant_is_shorter_too() -> None:
    """R C / (1 + gain) = 800 s: after it, 36.8 % of a rise is left."""
    warming = Warming([0.0, 800.0], 0.0, 0.0, 20.0, 1.0)
    cooled = spindle_temperature_c(THERMAL | GAIN, warming, 30.0, effects=["coolant_cooling"])
    assert cooled[0, -1] == pytest.approx(20.0 + 10.0 * np.exp(-1.0))
