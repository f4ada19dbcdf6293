"""Measured series without what lies above a stated bandwidth: forwards and backwards through a low pass, so nothing is late.

|H(f)|² of one pass of a Butterworth filter of second order = 1 / (1 + (f / f_c)⁴); both passes together have that gain
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

Floats = NDArray[np.float64]
HOLE = 2.5
"""Sample periods beyond which neighbouring samples say nothing of what was between them."""
NYQUIST_MAX = 0.8
"""Part of the Nyquist frequency above which there is nothing to take away."""


def low_passed(values: Floats, period_s: float, cutoff_hz: float) -> Floats:
    """Return values, (…, n), without what is faster than the cutoff; as they are where the samples hold nothing faster.

    >>> time_s = np.arange(2000) * 0.001
    >>> slow, fast = np.sin(2 * np.pi * 2.0 * time_s), np.sin(2 * np.pi * 200.0 * time_s)
    >>> bool(np.abs(low_passed(slow + fast, 0.001, 30.0) - slow)[200:-200].max() < 1e-3)
    True
    """
    part = 2.0 * cutoff_hz * period_s
    if part >= NYQUIST_MAX or values.shape[-1] < 2:
        return values
    sections = _sections(part)
    around = min(values.shape[-1] - 1, round(1.0 / (cutoff_hz * period_s)))
    return np.asarray(sosfiltfilt(sections, values, axis=-1, padlen=around))


@cache
def _sections(part: float) -> Floats:
    """The filter, by its cutoff over the Nyquist frequency."""
    return np.asarray(butter(2, part, output="sos"))


def filled(values: Floats) -> Floats:
    """Return (n,) with missing samples taken from their neighbours; 0 where there are none at all.

    Between even samples by a cubic spline, over holes and beyond the ends straight.
    """
    there = np.flatnonzero(np.isfinite(values))
    if len(there) in (0, len(values)):
        return np.nan_to_num(values)
    ticks = np.arange(len(values))
    straight = np.interp(ticks, there, values[there])
    if len(there) < 4:
        return straight
    apart = np.diff(there)
    before = np.clip(np.searchsorted(there, ticks, side="right") - 1, 0, len(apart) - 1)
    even = (apart[before] <= HOLE * np.median(apart)) & (ticks >= there[0]) & (ticks <= there[-1])
    return np.where(even, CubicSpline(there, values[there])(ticks), straight)


def sample_period_s(values: Floats, period_s: float) -> float:
    """Return the time from sample to sample of a series at ticks of `period_s`, NaN where there is none.

    >>> sample_period_s(np.array([0.0, np.nan, 1.0, np.nan, 2.0]), 0.001)
    0.002
    """
    there = np.flatnonzero(np.isfinite(values))
    return float(np.median(np.diff(there))) * period_s if len(there) > 1 else float("inf")


def velocity_of(position: Floats, period_s: float, cutoff_hz: float) -> Floats:
    """Return the velocity at each sample by central differences of fourth order, without what is faster than the cutoff.

        v = (8 (x₊₁ − x₋₁) − (x₊₂ − x₋₂)) / 12 T

    >>> velocity_of(np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0]), 0.5, 10.0).round(6).tolist()
    [2.0, 2.0, 2.0, 2.0, 2.0, 2.0]
    """
    smooth = low_passed(position, period_s, cutoff_hz)
    if len(smooth) < 2:
        return np.zeros(len(smooth))
    velocity = np.gradient(smooth, period_s)
    near, far = smooth[3:-1] - smooth[1:-3], smooth[4:] - smooth[:-4]
    velocity[2:-2] = (8.0 * near - far) / (12.0 * period_s)
    return np.asarray(velocity)
