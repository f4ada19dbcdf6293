"""The cutting force against figures made by hand, and where there is none."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.cutting import SpindleDrive, cutting_force, cutting_speed_m_s

DRIVE = SpindleDrive(rated_power_kw=11.0, efficiency=0.85, idle_power_kw=0.25)


def test_power_over_speed() -> None:
    # 40 % of 11 kW is 4.4 kW, less 0.25 kW idle, times 0.85 = 3527.5 W; 20 mm at 2,000 rev/min = 2.0944 m/s.
    force = cutting_force(DRIVE, 40.0, 2000.0, 20.0)
    assert force.force_n == pytest.approx(3527.5 / 2.0944, rel=1e-4)
    assert force.reason is None


def test_the_cutting_speed_is_the_circumference_times_the_speed() -> None:
    assert cutting_speed_m_s(10.0, 6000.0) == pytest.approx(math.pi)


def test_below_idle_power_the_force_is_zero() -> None:
    assert cutting_force(DRIVE, 1.0, 2000.0, 20.0).force_n == 0.0


@pytest.mark.parametrize(
    ("load", "rpm", "diameter", "word"),
    [
        (None, 2000.0, 20.0, "load is missing"),
        (math.nan, 2000.0, 20.0, "load is missing"),
        (-3.0, 2000.0, 20.0, "load is negative"),
        (40.0, None, 20.0, "speed is missing"),
        (40.0, math.inf, 20.0, "speed is missing"),
        (40.0, 0.0, 20.0, "below 50 rev/min"),
        (40.0, -49.0, 20.0, "below 50 rev/min"),
        (40.0, 2000.0, None, "diameter is not known"),
        (40.0, 2000.0, 0.0, "diameter is not known"),
        (1e308, 51.0, 1e-300, "beyond"),
    ],
)
def test_no_number_is_made_up(load: float | None, rpm: float | None, diameter: float | None, word: str) -> None:
    force, reason = cutting_force(DRIVE, load, rpm, diameter)
    assert force is None
    assert reason is not None
    assert word in reason


@given(st.floats(0, 200), st.floats(50, 60_000), st.floats(0.1, 300))
def test_the_force_is_never_negative_and_falls_with_speed(load: float, rpm: float, diameter: float) -> None:
    slow = cutting_force(DRIVE, load, rpm, diameter).force_n
    fast = cutting_force(DRIVE, load, 2 * rpm, diameter).force_n
    assert slow is not None
    assert fast is not None
    assert 0.0 <= fast <= slow
    assert slow == pytest.approx(2 * fast)


@pytest.mark.parametrize(
    "figures", [(0.0, 0.85, 0.0, 50.0), (11.0, 1.2, 0.0, 50.0), (11.0, 0.85, 12.0, 50.0), (11.0, 0.85, 0.0, 0.0)]
)
def test_a_meaningless_drive_is_refused(figures: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="has to be"):
        SpindleDrive(*figures)
