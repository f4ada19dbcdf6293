"""A meter with another 100 %."""

import pytest

from twin.spindle.load import spindle_load_pct


def test_half_the_rated_power_shows_twice_the_load() -> None:
    drive = {"rated_power_kw": 10.0, "efficiency": 0.8, "idle_power_kw": 0.5, "rated_power__scale": 0.5}
    assert spindle_load_pct(drive, [1600.0], 3000.0)[0, 0] == pytest.approx(25.0)
    assert spindle_load_pct(drive, [1600.0], 3000.0, effects=["rated_power"])[0, 0] == pytest.approx(50.0)
