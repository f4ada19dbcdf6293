"""Vibration by hand: a sine's velocity is its acceleration over ω, wherever blocks end."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, sosfilt, sosfreqz
from scipy.stats import kurtosis

from twin.vibration import (
    MM_PER_M,
    STANDARD_GRAVITY_M_S2,
    Band,
    Figures,
    Floats,
    Tally,
    band,
    figures,
    filtered,
    started,
    tallied,
    together,
)

RATE_HZ = 10_000.0
MM_S2 = STANDARD_GRAVITY_M_S2 * MM_PER_M


def sine(frequency_hz: float, peak_g: float = 1.0, seconds: float = 3.0, rate_hz: float = RATE_HZ) -> Floats:
    """A sine of acceleration."""
    return peak_g * np.sin(2.0 * math.pi * frequency_hz * np.arange(round(seconds * rate_hz)) / rate_hz)


def of_window(samples_g: Floats, rate_hz: float = RATE_HZ, low_hz: float = 10.0, high_hz: float = 1000.0) -> Figures:
    """The figures of all but the first second."""
    filters = band(rate_hz, low_hz, high_hz)
    _, acceleration, velocity = filtered(filters, started(filters, samples_g[0]), samples_g)
    kept = slice(round(rate_hz), None)
    return figures(tallied(samples_g[kept], acceleration[kept], velocity[kept]))


def integrated_by_fft(acceleration_g: Floats, rate_hz: float = RATE_HZ) -> Floats:
    """The oracle: acceleration over jω, mm/s. The record has to hold whole periods."""
    spectrum = np.fft.rfft(acceleration_g * MM_S2)
    omega = 2.0 * math.pi * np.fft.rfftfreq(acceleration_g.size, 1.0 / rate_hz)
    spectrum[1:] /= 1j * omega[1:]
    spectrum[0] = 0.0
    velocity: Floats = np.fft.irfft(spectrum, acceleration_g.size)
    return velocity


def test_a_sine_of_1_g_at_100_hz_is_9_81_over_omega_over_root_2() -> None:
    found = of_window(sine(100.0))
    assert found.velocity_mm_s == pytest.approx(9806.65 / (2.0 * math.pi * 100.0) / math.sqrt(2.0), rel=1e-4)  # 11.04 mm/s
    assert found.rms_g == pytest.approx(1.0 / math.sqrt(2.0), rel=1e-4)
    assert found.peak_g == pytest.approx(1.0, rel=1e-6)
    assert found.crest_factor == pytest.approx(math.sqrt(2.0), rel=1e-6)
    assert found.kurtosis == pytest.approx(1.5, rel=1e-6)


@pytest.mark.parametrize("rate_hz", [4_000.0, 10_000.0, 25_600.0])
@pytest.mark.parametrize("frequency_hz", [20.0, 50.0, 100.0, 320.0, 640.0, 800.0])
def test_within_the_band_velocity_is_the_bands_acceleration_over_omega(frequency_hz: float, rate_hz: float) -> None:
    found = of_window(sine(frequency_hz, rate_hz=rate_hz), rate_hz)
    over_omega = found.rms_g * MM_S2 / (2.0 * math.pi * frequency_hz)
    assert found.velocity_mm_s == pytest.approx(over_omega, rel=1.5e-2 if rate_hz == 4_000.0 else 5e-4)


@pytest.mark.parametrize(("frequency_hz", "gain"), [(10.0, 0.5**0.5), (1000.0, 0.5**0.5), (1.0, 0.0), (4000.0, 0.0)])
def test_the_band_ends_where_it_says(frequency_hz: float, gain: float) -> None:
    found = of_window(sine(frequency_hz, seconds=6.0))
    assert found.rms_g * math.sqrt(2.0) == pytest.approx(gain, abs=5e-3)


def test_noise_has_the_velocity_that_fft_integration_gives() -> None:
    """White noise, one second repeated, so that the FFT sees whole periods and the filter has settled."""
    second = np.random.default_rng(5).normal(0.0, 0.3, round(RATE_HZ))
    filters = band(RATE_HZ)
    _, acceleration, velocity = filtered(filters, started(filters, 0.0), np.tile(second, 4))
    oracle = integrated_by_fft(acceleration[-second.size :])
    assert math.sqrt(np.mean(velocity[-second.size :] ** 2)) == pytest.approx(math.sqrt(np.mean(oracle**2)), rel=5e-4)


def test_the_band_is_scipys() -> None:
    noise = np.random.default_rng(6).normal(0.0, 1.0, 5000)
    filters = band(RATE_HZ)
    plain = sosfilt(butter(4, (10.0, 1000.0), "bandpass", output="sos", fs=RATE_HZ), noise)
    assert np.allclose(filtered(filters, started(filters, 0.0), noise)[1], plain, atol=1e-9)


def test_velocity_has_no_pole_at_rest_so_nothing_drifts() -> None:
    filters: Band = band(RATE_HZ)
    _, response = sosfreqz(filters.velocity, worN=[1e-9])
    assert abs(response[0]) < 1e-6
    gravity = np.full(200_000, 1.0)
    _, _, velocity = filtered(filters, started(filters, 1.0), gravity)
    assert np.abs(velocity).max() < 1e-5  # mm/s: an integrator would be at 200 m/s by now


def test_gravity_is_no_step() -> None:
    on_its_side = of_window(sine(100.0))
    upright = of_window(sine(100.0) + 1.0)
    assert upright.velocity_mm_s == pytest.approx(on_its_side.velocity_mm_s, rel=1e-6)
    assert upright.kurtosis == pytest.approx(1.5, rel=1e-6)
    assert upright.peak_g == pytest.approx(1.0, rel=1e-6)


def test_impacts_raise_crest_factor_and_kurtosis() -> None:
    quiet = np.random.default_rng(7).normal(0.0, 0.05, 30_000)
    knocks = quiet.copy()
    knocks[::500] += 1.0
    assert of_window(quiet).kurtosis == pytest.approx(3.0, abs=0.1)
    knocked = of_window(knocks)
    assert knocked.kurtosis is not None and knocked.kurtosis > 50.0
    assert knocked.crest_factor is not None and knocked.crest_factor > 10.0


def test_nothing_that_shakes_has_no_crest_factor() -> None:
    still = figures(tallied(np.zeros(100), np.zeros(100), np.zeros(100)))
    assert still == Figures(0.0, 0.0, 0.0, None, None)


def test_a_rate_that_is_too_low_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="at 2560 Hz: use at least 4000 Hz"):
        band(2560.0)


@given(cuts=st.lists(st.integers(1, 2999), max_size=6, unique=True), offset_g=st.sampled_from([0.0, 1.0, -40.0]))
@settings(max_examples=60, deadline=None)
def test_where_blocks_end_does_not_matter(cuts: list[int], offset_g: float) -> None:
    signal = offset_g + np.random.default_rng(8).normal(0.0, 0.01, 3000)
    filters = band(RATE_HZ)
    whole = tallied(signal, *filtered(filters, started(filters, signal[0]), signal)[1:])
    carried, tally = started(filters, signal[0]), Tally()
    for block in np.split(signal, sorted(cuts)):
        carried, acceleration, velocity = filtered(filters, carried, block)
        tally = together(tally, tallied(block, acceleration, velocity))
    assert tally.moments.samples == whole.moments.samples
    assert figures(tally) == pytest.approx(figures(whole), rel=1e-9)


@given(values=st.lists(st.floats(-100.0, 100.0), min_size=2, max_size=50), cut=st.integers(0, 50))
@settings(max_examples=200, deadline=None)
def test_moments_add_up_to_those_of_scipy(values: list[float], cut: int) -> None:
    signal = np.array(values)
    if signal.std() < 1e-3:
        return
    parts = [tallied(part, part, part) for part in (signal[:cut], signal[cut:])]
    found = figures(together(*parts))
    assert found.kurtosis == pytest.approx(float(kurtosis(signal, fisher=False)), rel=1e-6)
    assert found.rms_g == pytest.approx(math.sqrt(np.mean(signal**2)))


def test_one_g_of_gravity_does_not_swallow_a_hundred_thousandth() -> None:
    """Sums of raw powers would leave no digit of the fourth moment."""
    shaking = np.random.default_rng(9).normal(0.0, 1e-5, 20_000)
    parts = [tallied(part + 1.0, part, part) for part in np.split(shaking, 20)]
    tally = Tally()
    for part in parts:
        tally = together(tally, part)
    assert figures(tally).kurtosis == pytest.approx(float(kurtosis(shaking, fisher=False)), rel=1e-5)
