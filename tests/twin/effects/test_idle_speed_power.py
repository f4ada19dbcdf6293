"""Idle power that grows with the speed."""

import numpy as np
import pytest

from twin.spindle.load import spindle_load_pct

DRIVE = {"rated_power_kw": 10.0, "efficiency": 0.8, "idle_power_kw": 0.5}
VALUES = {"idle_speed_power__exponent": 2.0, "idle_speed_power__power_kw": 0.4}


def test_twice_the_speed_takes_four_times_the_power_beyond_the_stated_one() -> None:
    """0.5 kW at rest, 0.6 at 2,500 rev/min of either sense, 0.9 at 5,000, 2.1 at 10,000."""
    speeds = np.array([0.0, 2500.0, -2500.0, 5000.0, 10000.0])
    load = spindle_load_pct(DRIVE | VALUES, np.zeros(5), speeds, effects=["idle_speed_power"])
    assert load[0] == pytest.approx([5.0, 6.0, 6.0, 9.0, 21.0])
