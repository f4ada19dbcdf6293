"""Tests whether a gap exceeds the repeatability, for samples that are correlated in time, many cells at once.

A gap is given in floors, ρ = (twin − recording) / floor, so that what repeats has a mean of 0 and an rms of 1. n samples with an
integral autocorrelation time τ = 1 + 2 Σ r_k are worth n / τ independent ones; the sum ends at the first lag M ≥ 5 τ(M) (Sokal
1997, Monte Carlo methods in statistical mechanics, section 3), and what centring takes away is given back by the factor
1 + (2M + 1) / n (Wolff 2004, Comput. Phys. Commun. 156, eq. 49). Then

    mean:    z = (|mean ρ| − δ) √(n/τ) / κ, normal
    energy:  (n/τ) mean ρ² / κ², χ² with n/τ degrees of freedom

and p is twice the smaller, at most 1. The floor says how far what repeats departs, so nothing is estimated of the gap but τ, and
structure in it does not hide it. δ and κ are how well a floor is known that comes from two runs: a mean of half of it and an rms
of 1.15 of it are no gap. Discoveries: Benjamini and Hochberg 1995, J. R. Stat. Soc. B 57(1).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.stats import chi2, norm

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

MEAN_TOLERANCE = 0.5
RMS_TOLERANCE = 1.15
FALSE_DISCOVERIES = 0.05
WINDOW_TIMES = 5.0
LAG_PART = 0.25
"""Lags up to this part of a series are looked at: a quarter, or a mean would have fewer than four pieces."""
SMALLEST_P = 1e-300


@dataclass(frozen=True, slots=True, eq=False)
class Means:
    """Figures of each cell, (cells,): number of samples, mean, rms, and the samples that they are worth, at least 1."""

    count: NDArray[np.intp]
    mean: Floats
    rms: Floats
    worth: Floats

    @property
    def error(self) -> Floats:
        """Standard error of the mean of what repeats, (cells,), in floors."""
        return np.asarray(RMS_TOLERANCE / np.sqrt(self.worth))

    def p_mean(self) -> Floats:
        """p of the mean being no further from 0 than MEAN_TOLERANCE, (cells,)."""
        return np.where(self.count > 0, p_of(self.mean, self.error), 1.0)

    def p_energy(self) -> Floats:
        """p of the rms being no larger than RMS_TOLERANCE, (cells,)."""
        p = np.maximum(chi2.sf(self.worth * (self.rms / RMS_TOLERANCE) ** 2, self.worth), SMALLEST_P)
        return np.where(self.count > 0, p, 1.0)

    def p(self) -> Floats:
        """p of both, (cells,); 1 where there is no sample."""
        return np.minimum(1.0, 2.0 * np.minimum(self.p_mean(), self.p_energy()))


def p_of(departure: Floats, error: Floats) -> Floats:
    """p of a departure being no more than MEAN_TOLERANCE, both in floors, given its standard error."""
    beyond = np.maximum(np.abs(departure) - MEAN_TOLERANCE, 0.0)
    return np.maximum(2.0 * norm.sf(beyond / error), SMALLEST_P)


def means_of(gap: Floats, cells: Bools, pieces: Floats | None = None) -> Means:
    """Means over the samples of each cell, and what they are worth.

    gap: (n,), in floors; cells: (cells, n), which samples are in which; those that are NaN are in none
    pieces: (cells,) samples that a cell is worth at most, where that is known beforehand

    A constant gap of 2 floors in white noise of 1: rms √5, and all samples count.

    >>> gap = 2.0 + np.random.default_rng(1).standard_normal(4000)
    >>> found = means_of(gap, np.ones((1, 4000), dtype=bool))
    >>> [round(float(v[0]), 1) for v in (found.mean, found.rms)], bool(found.worth[0] > 3000)
    ([2.0, 2.2], True)
    """
    there = cells & np.isfinite(gap)
    known = np.where(np.isfinite(gap), gap, 0.0)
    count = there.sum(axis=1)
    many = np.maximum(count, 1)
    mean = (there @ known) / many
    square = (there @ known**2) / many
    centred = np.where(there, known - mean[:, None], 0.0)
    worth = count / np.array([correlation_time(row) for row in centred])
    worth = worth if pieces is None else np.minimum(worth, pieces)
    return Means(count, mean, np.sqrt(square), np.maximum(worth, 1.0))


def correlation_time(centred: Floats) -> float:
    """Integral autocorrelation time in samples, at least 1, of a centred series (n,) that is 0 where there is no sample.

    >>> noise = np.random.default_rng(1).standard_normal(40000)
    >>> smooth = np.convolve(noise, np.ones(20) / 20, mode="same")  # a moving mean over 20 samples: τ = 20
    >>> 15 < correlation_time(smooth) < 25
    True
    """
    there = np.flatnonzero(centred)
    if len(there) < 4:
        return 1.0
    series = centred[there[0] : there[-1] + 1]
    lags = max(2, int(LAG_PART * len(series)))
    size = next_fast_len(len(series) + lags, real=True)
    power = np.abs(rfft(series, size)) ** 2
    product = irfft(power, size)[:lags]
    times = 2.0 * np.cumsum(product / product[0]) - 1.0
    enough = np.flatnonzero(np.arange(lags) >= WINDOW_TIMES * times)
    window = int(enough[0]) if len(enough) else int(np.argmax(times))
    return float(max(1.0, times[window] * (1.0 + (2 * window + 1) / len(there))))


def discoveries(p: Floats, rate: float = FALSE_DISCOVERIES) -> Bools:
    """Which of these p values stand when at most a part `rate` of those that stand is to be false, (n,).

    >>> discoveries(np.array([0.001, 0.02, 0.04, 0.5])).tolist()
    [True, True, False, False]
    """
    order = np.argsort(p)
    below = np.flatnonzero(p[order] <= rate * np.arange(1, len(p) + 1) / max(len(p), 1))
    stands = np.zeros(len(p), dtype=bool)
    if len(below):
        stands[order[: below[-1] + 1]] = True
    return stands
