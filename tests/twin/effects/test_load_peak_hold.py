"""A meter that holds its peaks: up at once, down by its time."""

import numpy as np
import pytest

from twin.spindle.load import spindle_load_pct

DRIVE = {"rated_power_kw": 10.0, "efficiency": 1.0, "idle_power_kw": 1.0, "load_peak_hold__hold_s": 0.5}


def test_a_peak_falls_to_37_percent_in_its_time_but_not_below_the_load() -> None:
    """9 kW of cut for 0.2 s, then air: 100 %, half a second later 36.8 %, and 10 % in the end."""
    power = np.where(np.arange(3000) < 200, 9000.0, 0.0)
    bare = spindle_load_pct(DRIVE, power, 3000.0)[0]
    held = spindle_load_pct(DRIVE, power, 3000.0, effects=["load_peak_hold"])[0]
    assert np.array_equal(held[:200], bare[:200])
    assert held[699] == pytest.approx(100.0 * np.exp(-1.0))
    assert held[-1] == 10.0
    assert (held >= bare).all()
