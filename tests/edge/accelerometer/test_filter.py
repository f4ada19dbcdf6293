"""The edge's filter is the twin's: the same figures, without numpy."""

import math
import random
import time

import numpy as np
import pytest

from edge.accelerometer.filter import Carried, Sums, band, filtered, started
from twin import vibration


def shaken(rate_hz: float, seconds: float, seed: int = 1) -> list[float]:
    """Noise and two sines on 1 g of gravity."""
    chance = random.Random(seed)
    times = (number / rate_hz for number in range(round(rate_hz * seconds)))
    return [1.0 + 0.3 * math.sin(754.0 * t) + 0.1 * math.sin(94.0 * t) + chance.gauss(0.0, 0.2) for t in times]


def of_the_edge(samples_g: list[float], rate_hz: float, cut: int) -> Sums:
    carried, total = started(band(rate_hz), samples_g[0]), Sums()
    for at in range(0, len(samples_g), cut):
        carried, sums = filtered(band(rate_hz), carried, samples_g[at : at + cut])
        total = total.plus(sums)
    return total


@pytest.mark.parametrize("rate_hz", [4000.0, 5120.0, 10_000.0, 12_800.0, 25_600.0, 51_200.0])
def test_it_gives_the_figures_of_the_twin_to_nine_digits(rate_hz: float) -> None:
    samples_g = shaken(rate_hz, 1.0)
    filters = vibration.band(rate_hz)
    start = vibration.started(filters, samples_g[0])
    _, acceleration, velocity = vibration.filtered(filters, start, np.array(samples_g))
    found = of_the_edge(samples_g, rate_hz, 777)
    assert found.rms_g == pytest.approx(math.sqrt(float(acceleration @ acceleration) / acceleration.size), rel=1e-9)
    assert found.velocity_mm_s == pytest.approx(math.sqrt(float(velocity @ velocity) / velocity.size), rel=1e-9)


def test_where_blocks_end_does_not_matter() -> None:
    samples_g = shaken(10_000.0, 0.5)
    whole, cut = of_the_edge(samples_g, 10_000.0, 5000), of_the_edge(samples_g, 10_000.0, 13)
    assert whole.samples == cut.samples
    assert whole.acceleration == pytest.approx(cut.acceleration, rel=1e-12)


def test_a_sine_of_1_g_at_100_hz_is_what_the_textbook_says() -> None:
    """rms 0.7071 g; velocity 9806.65 mm/s² / (2 pi 100 Hz) * 0.7071 = 11.04 mm/s."""
    samples_g = [math.sin(2 * math.pi * 100.0 * number / 10_000.0) for number in range(20_000)]
    carried, _ = filtered(band(10_000.0), started(band(10_000.0), 0.0), samples_g[:10_000])
    _, sums = filtered(band(10_000.0), carried, samples_g[10_000:])
    assert sums.rms_g == pytest.approx(0.7071, abs=0.0005)
    assert sums.velocity_mm_s == pytest.approx(11.04, abs=0.02)


def test_gravity_alone_shakes_nothing_and_never_will() -> None:
    carried, sums = filtered(band(10_000.0), started(band(10_000.0), 1.0), [1.0] * 30_000)
    assert sums.rms_g < 1e-9
    assert sums.velocity_mm_s < 1e-5
    assert isinstance(carried, Carried)


def test_a_rate_too_low_for_the_band_is_refused() -> None:
    with pytest.raises(ValueError, match="a sample rate of 3999 Hz is below 4000"):
        band(3999.0)


def test_it_costs_less_than_a_tenth_of_a_core_at_10_khz() -> None:
    samples_g, taken_s = shaken(10_000.0, 1.0), []
    for _ in range(5):  # the quickest, as a core that others use as well takes longer for the same
        began_s = time.process_time()
        filtered(band(10_000.0), started(band(10_000.0), 1.0), samples_g)
        taken_s.append(time.process_time() - began_s)
    assert min(taken_s) < 0.1
