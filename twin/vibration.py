"""Vibration of a spindle from blocks of acceleration: streaming band-pass, velocity, and the moments of the whole signal.

Band-pass: Butterworth, order 4 at each edge, 10 to 1000 Hz at -3 dB (ISO 2954). Velocity is the integral of the same band, in one
filter: of the band-pass's four zeros at z = 1 one is taken out, which is the pole of the integrator

    H(z) = T (b0 + b1/z) / (1 - 1/z),   b0 + b1 = 1,   b0 b1 = 1/12

so nothing can drift away. With b0 b1 = 1/12, |H| is that of 1/ω to the fourth order (at a tenth of the sample rate 0.03 % too
high; the trapezoidal rule, b0 = b1, is 3.3 % too low there). Its phase is not that of an integrator, and an rms has none.

The filter's state is carried from block to block, and windows are counted in samples, so where a block ends does not matter.
Moments of blocks are added up by Chan's and Pébay's formulas, so that 1 g of gravity does not swallow what shakes on it.

Pébay, P.: Formulas for robust, one-pass parallel computation of covariances and arbitrary-order statistical moments,
SAND2008-6212.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt, sosfilt_zi, zpk2sos

Floats = NDArray[np.float64]
Sections = tuple[tuple[float, float], ...]
"""Two states of each section of a filter."""

STANDARD_GRAVITY_M_S2 = 9.80665
MM_PER_M = 1000.0
ORDER = 4
LEADING = (1.0 + math.sqrt(2.0 / 3.0)) / 2.0
"""b0 of the integrator; b1 = 1 - b0."""
RATE_BANDS_MIN = 4.0
"""The sample rate is at least so many times the upper edge: there the integrator is 1.4 % too high at the edge."""


@dataclass(frozen=True, slots=True)
class Band:
    """The filters of one sample rate, as sections; `start` is their state after an eternity of 1 g."""

    acceleration: Floats
    velocity: Floats
    acceleration_start: Floats
    velocity_start: Floats


@lru_cache(maxsize=32)
def band(rate_hz: float, low_hz: float = 10.0, high_hz: float = 1000.0) -> Band:
    """Design the filters from acceleration in g to that of the band, and to velocity in mm/s. ValueError at too low a rate.

    >>> band(10_000.0).velocity.shape
    (4, 6)
    """
    if not 0.0 < low_hz < high_hz or rate_hz < RATE_BANDS_MIN * high_hz:
        raise ValueError(f"band {low_hz:g} to {high_hz:g} Hz at {rate_hz:g} Hz: use at least {RATE_BANDS_MIN * high_hz:g} Hz")
    zeros, poles, gain = butter(ORDER, (low_hz, high_hz), "bandpass", output="zpk", fs=rate_hz)
    kept = np.delete(zeros, int(np.argmin(np.abs(zeros - 1.0))))
    integrated = np.append(kept, -(1.0 - LEADING) / LEADING)
    velocity_gain = gain * LEADING / rate_hz * STANDARD_GRAVITY_M_S2 * MM_PER_M
    acceleration: Floats = zpk2sos(zeros, poles, gain)  # type: ignore[arg-type]  # poles are complex, whatever the stubs say
    velocity: Floats = zpk2sos(integrated, poles, velocity_gain)  # type: ignore[arg-type]
    return Band(acceleration, velocity, sosfilt_zi(acceleration), sosfilt_zi(velocity))


class Moments(NamedTuple):
    """The moments of so many values: mean, sums of the 2nd, 3rd and 4th powers about it, least and greatest."""

    samples: int = 0
    mean: float = 0.0
    m2: float = 0.0
    m3: float = 0.0
    m4: float = 0.0
    least: float = 0.0
    greatest: float = 0.0


class Tally(NamedTuple):
    """The sums of a stretch of samples: moments of the whole signal in g, sums of squares of its band in g² and (mm/s)²."""

    moments: Moments = Moments()
    acceleration: float = 0.0
    velocity: float = 0.0


class Carried(NamedTuple):
    """The states of both filters."""

    acceleration: Sections
    velocity: Sections


class Figures(NamedTuple):
    """The figures of a window. Rms are of the band; peak, crest factor and kurtosis of the whole signal, about its mean.

    crest_factor, kurtosis: None where nothing shakes
    """

    rms_g: float
    velocity_mm_s: float
    peak_g: float
    crest_factor: float | None
    kurtosis: float | None


def started(filters: Band, first_g: float) -> Carried:
    """The filters as if the first value had stood for ever: gravity is no step to them."""
    return Carried(_sections(filters.acceleration_start * first_g), _sections(filters.velocity_start * first_g))


def filtered(filters: Band, carried: Carried, samples_g: Floats) -> tuple[Carried, Floats, Floats]:
    """Acceleration in g and velocity in mm/s of the band, and the state after it."""
    acceleration, acceleration_z = sosfilt(filters.acceleration, samples_g, zi=np.array(carried.acceleration))
    velocity, velocity_z = sosfilt(filters.velocity, samples_g, zi=np.array(carried.velocity))
    return Carried(_sections(acceleration_z), _sections(velocity_z)), acceleration, velocity


def tallied(samples_g: Floats, acceleration_g: Floats, velocity_mm_s: Floats) -> Tally:
    """The tally of some samples, with their band."""
    if not samples_g.size:
        return Tally()
    mean = float(samples_g.mean())
    off = samples_g - mean
    square = off * off
    moments = Moments(
        samples_g.size,
        mean,
        float(square.sum()),
        float(square @ off),
        float(square @ square),
        float(samples_g.min()),
        float(samples_g.max()),
    )
    return Tally(moments, float(acceleration_g @ acceleration_g), float(velocity_mm_s @ velocity_mm_s))


def together(left: Tally, right: Tally) -> Tally:
    """The tally of two stretches."""
    one, two = left.moments, right.moments
    if not one.samples or not two.samples:
        return right if not one.samples else left
    n, a, b = one.samples + two.samples, one.samples, two.samples
    step = two.mean - one.mean
    m2 = one.m2 + two.m2 + step * step * a * b / n
    m3 = one.m3 + two.m3 + step**3 * a * b * (a - b) / n**2 + 3.0 * step * (a * two.m2 - b * one.m2) / n
    m4 = (
        one.m4
        + two.m4
        + step**4 * a * b * (a * a - a * b + b * b) / n**3
        + 6.0 * step * step * (a * a * two.m2 + b * b * one.m2) / n**2
        + 4.0 * step * (a * two.m3 - b * one.m3) / n
    )
    moments = Moments(n, one.mean + step * b / n, m2, m3, m4, min(one.least, two.least), max(one.greatest, two.greatest))
    return Tally(moments, left.acceleration + right.acceleration, left.velocity + right.velocity)


def figures(tally: Tally) -> Figures:
    """Return the figures of a tally; it has to hold a sample.

    >>> figures(Tally(Moments(4, 1.0, 4.0, 0.0, 4.0, 0.0, 2.0), 4.0, 36.0))
    Figures(rms_g=1.0, velocity_mm_s=3.0, peak_g=1.0, crest_factor=1.0, kurtosis=1.0)
    """
    moments = tally.moments
    count = moments.samples
    deviation = math.sqrt(max(moments.m2, 0.0) / count)
    peak_g = max(moments.greatest - moments.mean, moments.mean - moments.least)
    shakes = moments.m2 > 0.0 and deviation > 1e-12
    return Figures(
        math.sqrt(tally.acceleration / count),
        math.sqrt(tally.velocity / count),
        peak_g,
        peak_g / deviation if shakes else None,
        count * moments.m4 / (moments.m2 * moments.m2) if shakes else None,
    )


def _sections(states: Floats) -> Sections:
    return tuple((float(first), float(second)) for first, second in states)
