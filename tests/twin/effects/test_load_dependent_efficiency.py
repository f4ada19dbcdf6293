"""A drive that is less efficient at low load: hand figures at no power, at the knee and far above it."""

import math

import pytest

from twin.effects.load_dependent_efficiency import efficiency
from twin.spindle.load import spindle_load_pct


@pytest.mark.parametrize(
    ("power_kw", "expected"), [(0.0, 0.8 * 0.7), (0.6, 0.8 * (1 - 0.3 * math.exp(-1.0))), (30.0, 0.8)], ids=str
)
def test_the_drop_goes_off_with_the_power(power_kw: float, expected: float) -> None:
    assert efficiency(0.8, power_kw, 0.3, 0.6) == pytest.approx(expected)


def test_a_small_cut_shows_more_load_than_its_share() -> None:
    """0.6 kW at η = 0.8 · (1 − 0.3/e) = 0.7117 are 0.843 kW of 10 kW."""
    drive = {"rated_power_kw": 10.0, "efficiency": 0.8, "idle_power_kw": 0.0}
    values = {"load_dependent_efficiency__drop": 0.3, "load_dependent_efficiency__knee_kw": 0.6}
    load = spindle_load_pct(drive | values, [600.0], 3000.0, effects=["load_dependent_efficiency"])
    assert load[0, 0] == pytest.approx(8.4304, abs=1e-4)
