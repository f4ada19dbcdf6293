"""The load meter: its equation, its window, its effects' place, and recordings of an independent reference machine."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.errors import EffectError, TwinError
from twin.machine import SpindleDrive
from twin.spindle.load import spindle_constants, spindle_load_pct

DRIVE = spindle_constants(SpindleDrive(rated_power_kw=10.0, efficiency=0.8, idle_power_kw=0.5))
EFFECTS = {
    "load_peak_hold": {"hold_s": 0.5},
    "load_dependent_efficiency": {"drop": 0.3, "knee_kw": 0.6},
    "rated_power": {"scale": 1.3},
    "idle_speed_power": {"exponent": 2.0, "power_kw": 0.3},
}
NULL = {
    "load_peak_hold": {"hold_s": 0.0},
    "load_dependent_efficiency": {"drop": 0.0, "knee_kw": 0.6},
    "rated_power": {"scale": 1.0},
    "idle_speed_power": {"exponent": 2.0, "power_kw": 0.0},
}


def of(effects: dict[str, dict[str, float]]) -> dict[str, float]:
    return {f"{effect}__{name}": value for effect, values in effects.items() for name, value in values.items()}


def test_an_even_cut_shows_its_power() -> None:
    """4 kW of cut are 5 kW at the motor and 5.5 with the idle power: 55 %."""
    assert spindle_load_pct(DRIVE, np.full(5, 4000.0), 3000.0) == pytest.approx(np.full((1, 5), 55.0))


def test_a_step_comes_through_in_a_tenth_of_a_second() -> None:
    power = np.where(np.arange(400) < 150, 0.0, 4000.0)
    load = spindle_load_pct(DRIVE, power, 3000.0)[0]
    assert load[149] == 5.0
    assert load[199] == pytest.approx(5.0 + 25.0)
    assert load[249] == pytest.approx(55.0)
    assert load[150:250] == pytest.approx(5.0 + 0.5 * np.arange(1, 101))


@given(st.lists(st.floats(0.0, 5000.0), min_size=1, max_size=60), st.sampled_from([0.1, 0.02, 0.01]))
def test_the_window_is_the_mean_of_the_last_ticks_that_there_are(power: list[float], period_s: float) -> None:
    window = round(0.1 / period_s)
    load = spindle_load_pct(DRIVE, power, 1000.0, period_s=period_s)[0]
    for tick in range(len(power)):
        mean_kw = np.mean(power[max(0, tick + 1 - window) : tick + 1]) / 1000.0
        assert load[tick] == pytest.approx(100.0 * (mean_kw / 0.8 + 0.5) / 10.0)


def test_after_a_cut_nothing_of_it_is_left() -> None:
    power = np.concatenate([np.full(1000, 1234.567), np.zeros(1000)])
    assert spindle_load_pct(DRIVE, power, 3000.0)[0, -1] == 5.0


def test_null_effects_and_plain_python_change_no_bit() -> None:
    power = 2000.0 + 2000.0 * np.sin(np.arange(500) / 30.0)
    bare = spindle_load_pct(DRIVE, power, 3000.0)
    assert np.array_equal(bare, spindle_load_pct(DRIVE | of(NULL), power, 3000.0, effects=tuple(NULL)))
    given_ = DRIVE | of(EFFECTS)
    kernel = spindle_load_pct(given_, power, 3000.0, effects=tuple(EFFECTS))
    assert np.array_equal(kernel, spindle_load_pct(given_, power, 3000.0, effects=tuple(EFFECTS), reference_run=True))
    assert np.abs(kernel - bare).max() > 1.0


def test_lanes_are_machines_of_their_own() -> None:
    power = np.linspace(0.0, 3000.0, 300)
    lanes = spindle_load_pct(DRIVE | {"efficiency": [0.7, 0.8, 0.9]}, power, 3000.0)
    assert np.array_equal(lanes[1], spindle_load_pct(DRIVE, power, 3000.0)[0])
    own = spindle_load_pct(DRIVE, np.stack([power, power[::-1]]), 3000.0)
    assert np.array_equal(own[1], spindle_load_pct(DRIVE, power[::-1], 3000.0)[0])


def test_wrong_input_is_named() -> None:
    with pytest.raises(EffectError, match="idle_power_kw of the spindle is missing"):
        spindle_load_pct({"rated_power_kw": 10.0, "efficiency": 0.8}, [0.0], 0.0)
    with pytest.raises(EffectError, match="runout does not act on the spindle"):
        spindle_load_pct(DRIVE, [0.0], 0.0, effects=["runout"])
    with pytest.raises(TwinError, match="do not fit each other"):
        spindle_load_pct(DRIVE, [0.0, 1.0], [1.0, 2.0, 3.0])
