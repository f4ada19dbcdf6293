"""Sensors and clocks."""

import numpy as np
import pytest

from twin.effects.catalogue import effect_named
from twin.errors import EffectError
from twin.sensor.clock import resampled
from twin.sensor.reading import readings

STEP = np.concatenate([np.zeros(3), [np.nan], np.ones(5)])
SINCE = np.concatenate([[0.0], np.full(8, 0.01)])


def test_a_sensor_without_effects_reads_what_is() -> None:
    assert readings(STEP, SINCE, {}) is STEP


def test_a_lag_reads_63_percent_of_a_step_after_its_time_constant() -> None:
    read = readings(STEP, SINCE, {"sensor_lag": {"time_constant_s": 0.02}})
    assert np.isnan(read[3])
    assert read[5] == pytest.approx(1.0 - np.exp(-1.0), abs=1e-12)


def test_a_first_reading_is_settled() -> None:
    assert readings(STEP + 5.0, SINCE, {"sensor_lag": {"time_constant_s": 10.0}})[0] == 5.0


def test_bias_comes_before_lag_and_python_reads_the_same() -> None:
    effects = {"sensor_bias": {"bias": 2.0}, "sensor_lag": {"time_constant_s": 0.02}}
    kernel, python = readings(STEP, SINCE, effects), readings(STEP, SINCE, effects, reference_run=True)
    np.testing.assert_array_equal(kernel, python)
    assert kernel[0] == 2.0


def test_a_late_reading_is_the_value_of_before_between_the_samples_that_there_are() -> None:
    ramp = np.where(np.isnan(STEP), np.nan, np.arange(9.0))
    read = readings(ramp, SINCE, {"sensor_delay": {"delay_s": 0.015}})
    np.testing.assert_allclose(read, [0.0, 0.0, 0.5, np.nan, 2.5, 3.5, 4.5, 5.5, 6.5], atol=1e-12)
    python = readings(ramp, SINCE, {"sensor_delay": {"delay_s": 0.015}}, reference_run=True)
    np.testing.assert_array_equal(read, python)


def test_a_reading_that_is_later_than_the_recording_is_the_first_one() -> None:
    np.testing.assert_array_equal(readings(STEP + 5.0, SINCE, {"sensor_delay": {"delay_s": 60.0}})[[0, 8]], [5.0, 5.0])


def test_a_sensor_forgets_what_came_before_an_infinite_time() -> None:
    since = SINCE.copy()
    since[6] = np.inf
    effects = {"sensor_delay": {"delay_s": 0.01}, "sensor_lag": {"time_constant_s": 1.0}}
    assert readings(np.where(np.arange(9) < 6, 100.0, 3.0), since, effects)[6:] == pytest.approx([3.0, 3.0, 3.0])


@pytest.mark.parametrize("name", ["sensor_bias", "sensor_scale", "sensor_lag", "sensor_delay"])
def test_at_its_null_value_a_sensor_effect_is_not_there(name: str) -> None:
    np.testing.assert_array_equal(readings(STEP, SINCE, {name: effect_named(name).null_values()}), STEP)


def test_growth_needs_a_temperature() -> None:
    with pytest.raises(EffectError, match="needs a spindle temperature"):
        readings(STEP, SINCE, {"thermal_growth": {"um_per_k": 5.0}})
    grown = readings(np.zeros(9), SINCE, {"thermal_growth": {"um_per_k": 5.0}}, np.full(9, 2.0))
    np.testing.assert_allclose(grown, 0.01)


def test_an_effect_of_another_site_is_refused() -> None:
    with pytest.raises(EffectError, match="does not act on a sensor"):
        readings(STEP, SINCE, {"gravity": {"force_n": 1.0}})


def test_resampling_between_samples_is_linear_and_holds_the_ends() -> None:
    values = np.array([[0.0, 1.0, 4.0]])
    np.testing.assert_allclose(
        resampled(values, 0.001, np.array([-1.0, 0.0, 0.0005, 0.0015, 0.002, 1.0])), [[0, 0, 0.5, 2.5, 4, 4]]
    )
