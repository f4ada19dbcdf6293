"""The rate of chance: peaks over threshold of a null stream, and the threshold for a stated rate.

    z = −log(1 − score),  rate of peaks above z = n / T · (1 + ξ (z − z0) / σ)^(−1/ξ)      (Pickands 1975; Coles 2001, 4.3)

Scores end at 1; z has no end, so that no threshold lies beyond it. The largest third of the peaks is fitted, ξ and σ by
probability-weighted moments (Hosking and Wallis 1987), which a handful of peaks can bear. Intervals are those of a bootstrap over
the peaks, their number drawn from a Poisson law.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
PEAKS_FITTED_MAX = 60
PEAKS_FITTED_MIN = 8
DRAWS = 400
SCORE_MAX = 1.0 - 1e-9
SHAPE_MIN, SHAPE_MAX = -0.45, 0.5
"""Outside of these, moments of few peaks mean nothing."""


@dataclass(frozen=True, slots=True)
class Tail:
    """Peaks above u0 come `per_hour`, and fall off with shape ξ and scale σ; all of them as z."""

    u0: float
    shape: float
    scale: float
    per_hour: float

    def rate_per_hour(self, u: float) -> float:
        """Return the rate of peaks above u ≥ u0."""
        base = 1.0 + self.shape * (u - self.u0) / self.scale
        if base <= 0.0:
            return 0.0
        if abs(self.shape) < 1e-9:
            return float(self.per_hour * np.exp(-(u - self.u0) / self.scale))
        return float(self.per_hour * base ** (-1.0 / self.shape))

    def level(self, per_hour: float) -> float:
        """The u that is passed so often, at least u0."""
        ratio = max(self.per_hour / per_hour, 1.0)
        if abs(self.shape) < 1e-9:
            return float(self.u0 + self.scale * np.log(ratio))
        return float(self.u0 + self.scale / self.shape * (ratio**self.shape - 1.0))


@dataclass(frozen=True, slots=True)
class FalseRate:
    """False gates a day above `threshold`, with the 90 % interval.

    null_hours: of the stream that it rests on; peaks: that were fitted; seen: above the threshold in the null stream
    is_extrapolated: fewer than three were to be expected in that time, so the figure is a tail's, not a count
    """

    threshold: float
    per_day: float
    low: float
    high: float
    null_hours: float
    peaks: int
    seen: int
    is_extrapolated: bool


def tail_of(peaks: Floats, hours: float) -> Tail | None:
    """The tail of the largest peaks; None where there are too few."""
    if len(peaks) <= PEAKS_FITTED_MIN or hours <= 0.0:
        return None
    ordered = np.sort(_unbounded(peaks))[::-1]
    count = min(max(PEAKS_FITTED_MIN, len(ordered) // 3), PEAKS_FITTED_MAX)
    u0 = float(ordered[count])
    excess = np.sort(ordered[:count] - u0)
    mean = float(excess.mean())
    if mean <= 0.0:
        return None
    weights = (count - 1.0 - np.arange(count)) / (count - 1.0)
    moment = float((weights * excess).mean())
    shape = 2.0 - mean / (mean - 2.0 * moment) if mean > 2.0 * moment else SHAPE_MIN
    shape = float(np.clip(shape, SHAPE_MIN, SHAPE_MAX))
    return Tail(u0, shape, mean * (1.0 - shape), count / hours)


def threshold_for(peaks: Floats, hours: float, per_day: float) -> float | None:
    """The threshold that so many false gates a day pass; None where the null stream says too little."""
    tail = tail_of(peaks, hours)
    return None if tail is None else float(-np.expm1(-tail.level(per_day / 24.0)))


def false_rate(peaks: Floats, hours: float, threshold: float, rng: np.random.Generator) -> FalseRate:
    """Return the false gates a day to expect above a threshold."""
    seen = int((peaks > threshold).sum())
    rates = []
    for _ in range(DRAWS):
        drawn = rng.choice(peaks, rng.poisson(len(peaks))) if len(peaks) else peaks
        rates.append(_per_day(drawn, hours, threshold))
    low, high = np.quantile(rates, [0.05, 0.95])
    if seen == 0:
        high = max(high, 24.0 * 3.0 / hours if tail_of(peaks, hours) is None else high)  # none in T: below 3 / T with 95 %
    expected = _per_day(peaks, hours, threshold)
    return FalseRate(
        threshold,
        expected,
        float(low),
        float(high),
        hours,
        min(len(peaks), PEAKS_FITTED_MAX),
        seen,
        expected * hours / 24.0 < 3.0,
    )


def _per_day(peaks: Floats, hours: float, threshold: float) -> float:
    tail = tail_of(peaks, hours)
    seen = float((peaks > threshold).sum()) / hours
    at = float(_unbounded(np.array([threshold]))[0])
    if tail is None or at < tail.u0:
        return 24.0 * seen
    return 24.0 * tail.rate_per_hour(at)


def _unbounded(scores: Floats) -> Floats:
    return np.asarray(-np.log1p(-np.minimum(scores, SCORE_MAX)))
