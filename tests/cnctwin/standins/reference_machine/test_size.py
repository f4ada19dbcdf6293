"""Amplitudes are found by the size that they make."""

import numpy as np
import pytest

from cnctwin.standins.reference_machine.size import amplitude_for, rms_by_signal, sizes


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("target", [0.7, 5.0, 30.0])
def test_a_size_that_grows_by_a_power_is_met(power: float, target: float) -> None:
    def size_of(amplitude: float) -> float:
        return 10.0 * amplitude**power

    assert size_of(amplitude_for(target, size_of, 100.0)) == pytest.approx(target, rel=0.04)


def test_a_threshold_is_met_as_well() -> None:
    def size_of(amplitude: float) -> float:
        return max(0.0, 40.0 * (amplitude - 0.8))

    assert size_of(amplitude_for(6.0, size_of, 6.0)) == pytest.approx(6.0, rel=0.04)


def test_what_never_gets_so_large_is_as_large_as_it_gets() -> None:
    assert amplitude_for(20.0, lambda amplitude: amplitude, 3.0) == pytest.approx(3.0)


def test_what_is_never_so_small_is_as_small_as_it_gets() -> None:
    assert amplitude_for(1.0, lambda _: 5.0, 3.0, least=0.02) == pytest.approx(0.02, rel=0.05)


def test_a_size_is_a_difference_over_its_floor_in_what_sensors_read() -> None:
    one = {"x_pos_mm": np.zeros(100, dtype=np.float32), "x_ref_mm": np.zeros(100)}
    other = {"x_pos_mm": np.full(100, 0.003, dtype=np.float32), "x_ref_mm": np.ones(100)}
    differ = rms_by_signal([one], [other])
    assert differ == {"x_pos_mm": pytest.approx(0.003)}
    assert sizes(differ, {"x_pos_mm": 0.001}) == {"x_pos_mm": pytest.approx(3.0)}
