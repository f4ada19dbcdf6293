"""A threshold in alerts per machine-week, fitted on the score stream as it is: correlated in time, with dwell and hysteresis.

What counts is an alarm that comes on (`alarm.py`), not a sample above a line: a quantile of 1 % with a dwell of 3 at 10 Hz gave 9
to 7,226 alerts a week on streams of the same distribution and other correlation. Alarms at a threshold u are episodes; those at a
base u0 that has enough of them are its clusters, with maxima M of the dwell score (the least of the last k scores).

* Where the stretch saw many more alarms than are asked for, the threshold is read off: as many episodes as asked for.
* Else, from peaks over u0 (Davison and Smith 1990):  rate(u) = rate(u0) · (1 + ξ (u − u0) / σ)^(−1/ξ)
  The posterior of (σ, ξ) on a grid, ξ ~ N(0, 0.25²), rate(u0) ~ Gamma; the threshold is where the mean of rate(u) is what was
  asked for, so that a fleet has what was asked for. Beyond the largest score seen it is an extrapolation, and says so.
* Alarms that are waited for (`calm_ticks`) are fewer than their clusters; where a stretch has too few of them, it is fitted as if
  none were waited for, which asks for more.
* The interval has 90 %: Poisson where it was read off (Garwood 1936), else of the posterior. Where alarms come in bunches from
  block to block, all counts are divided by their index of dispersion first, which widens it.
* Too short a stretch is an error and no threshold; so are too few clusters, unless an alert is asked for in the stretch itself:
  then it is read off, with an interval as wide as that; just above 0 where no score was.

It holds for the future that is like the stretch: the same programs, season and disturbances, and no fault in it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

from twin.anomaly.alarm import calm_score, dwell_score
from twin.anomaly.errors import ModelError

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
WEEK_S, HOUR_S = 604_800.0, 3600.0
COVERAGE = 0.9
READ_OFF_MIN = 15.0
"""So many alarms have to be asked for in the stretch, for the threshold to be read off."""
CLUSTERS, CLUSTERS_MIN = 50, 20
EXPOSURE_MIN = 0.01
"""Shortest stretch, as a share of the mean time between the alerts that are asked for."""
BLOCKS = 30
JUST_ABOVE = 1e-6
SHAPES = np.linspace(-0.75, 0.75, 61)
LOG_SCALES = np.linspace(-1.5, 1.5, 61)
SHAPE_SD = 0.25
RATE_QUANTILES = (np.arange(21) + 0.5) / 21


@dataclass(frozen=True, slots=True)
class Threshold:
    """alerts_per_week: asked for; estimate, low, high: alerts a machine-week at the threshold, with an interval of 90 %
    hours: known and not gated; is_extrapolated: it lies beyond every score of the stretch; clusters: what it rests on
    """

    threshold: float
    alerts_per_week: float
    estimate: float
    low: float
    high: float
    hours: float
    is_extrapolated: bool
    clusters: int


@dataclass(frozen=True, slots=True)
class _Stream:
    """A stretch without a hole: dwell score, and calm score, −∞ and ∞ where unknown (`alarm.py`)."""

    least: Floats
    largest: Floats


@dataclass(frozen=True, slots=True)
class _Tail:
    """Posterior over a grid: rate at the base a week (weights), scale and shape of what lies above it."""

    base: float
    rates: Floats
    scales: Floats
    shapes: Floats
    weights: Floats

    def rate(self, threshold: float, share: float | None = None) -> float:
        """Alerts a week at a threshold above the base: the mean, or a quantile."""
        over = np.maximum(0.0, 1.0 + self.shapes * (threshold - self.base) / self.scales)
        with np.errstate(divide="ignore", over="ignore"):
            beyond = np.where(
                np.abs(self.shapes) < 1e-9, np.exp(-(threshold - self.base) / self.scales), over ** (-1.0 / self.shapes)
            )
        if share is None:
            return float((beyond * self.weights).sum() * self.rates.mean())
        rates = (beyond[:, None] * self.rates).ravel()
        order = np.argsort(rates)
        mass = np.cumsum(np.repeat(self.weights / len(self.rates), len(self.rates))[order])
        return float(rates[order][min(int(np.searchsorted(mass, share * mass[-1])), len(rates) - 1)])


def fit_threshold(
    scores: Sequence[Floats],
    gated: Sequence[Flags],
    tick_s: float,
    dwell_ticks: int,
    clear_fraction: float = 0.8,
    alerts_per_week: float = 1.0,
    calm_ticks: int = 0,
) -> Threshold:
    """The threshold that gives so many alerts a machine-week, from one or more stretches of adjusted scores (T,) without a hole.

    NaN is a score that is not known; several machines may be given together where they share a threshold. Raises ModelError where
    the stretches cannot tell.
    """
    known = [~np.isnan(one) for one in scores]
    weeks = sum(int(one.sum()) for one in known) * tick_s / WEEK_S
    hours = sum(int((one & ~shut).sum()) for one, shut in zip(known, gated, strict=True)) * tick_s / HOUR_S
    asked = alerts_per_week * weeks
    if not alerts_per_week > 0.0 or asked < EXPOSURE_MIN:
        need_h = EXPOSURE_MIN / max(alerts_per_week, 1e-9) * WEEK_S / HOUR_S
        raise ModelError(
            f"{hours:.1f} h of scores cannot tell of {alerts_per_week:g} alerts a week: "
            f"calibrate on {need_h:.0f} h or more, better on weeks"
        )
    streams = [
        _Stream(dwell_score(one, shut, dwell_ticks), calm_score(one, shut, dwell_ticks, calm_ticks))
        for one, shut in zip(scores, gated, strict=True)
    ]

    def maxima(threshold: float) -> list[Floats]:
        return [_episodes(stream, threshold, clear_fraction)[1] for stream in streams]

    found = _base(streams, lambda threshold: sum(map(len, maxima(threshold))), max(CLUSTERS, math.ceil(2.0 * asked)))
    if calm_ticks and (found is None or found[1] < CLUSTERS_MIN):
        return fit_threshold(scores, gated, tick_s, dwell_ticks, clear_fraction, alerts_per_week)
    if found is None and asked < 1.0:
        raise ModelError(f"no score in {hours:.1f} h is above 0, so no threshold can be fitted on them: calibrate on more hours")
    if found is None:
        most = float(gammaincinv(1.0, 0.5 + COVERAGE / 2)) / weeks
        return Threshold(JUST_ABOVE, alerts_per_week, 0.0, 0.0, most, hours, False, 0)
    base, clusters = found
    bunched = _dispersion([_episodes(stream, base, clear_fraction)[0] for stream in streams], [len(one) for one in scores])
    top = max(float(stream.least.max()) for stream in streams)
    if asked >= READ_OFF_MIN or (clusters < CLUSTERS_MIN and asked >= 1.0):
        return _read_off(maxima, (base, top), (asked, weeks, bunched), alerts_per_week, hours)
    if clusters < CLUSTERS_MIN:
        raise ModelError(
            f"{clusters} alarms in {hours:.1f} h at the lowest threshold that tells them apart, {CLUSTERS_MIN} are needed: "
            f"calibrate on more hours, or ask for more than {alerts_per_week:g} alerts a week"
        )
    tail = _tail(np.concatenate(maxima(base)), base, weeks, bunched)
    threshold = _where(lambda level: tail.rate(level) <= alerts_per_week, base, top)
    low, high = (tail.rate(threshold, share) for share in (0.5 - COVERAGE / 2, 0.5 + COVERAGE / 2))
    return Threshold(threshold, alerts_per_week, alerts_per_week, low, high, hours, threshold > top, clusters)


def _episodes(stream: _Stream, threshold: float, clear_fraction: float) -> tuple[NDArray[np.intp], Floats]:
    """Ticks at which an alarm comes on, and the largest dwell score of each."""
    high = np.flatnonzero(stream.least >= threshold)
    if not len(high):
        return high, np.empty(0)
    cleared = np.concatenate([[0], np.cumsum(stream.largest < clear_fraction * threshold)])
    begins = np.flatnonzero(np.concatenate([[True], cleared[high[1:]] > cleared[high[:-1]]]))
    return high[begins], np.maximum.reduceat(stream.least[high], begins)


def _base(streams: Sequence[_Stream], count: Callable[[float], int], wanted: int) -> tuple[float, int] | None:
    """The highest threshold with so many episodes; where there is none, the one with the most. None: no score is above 0."""
    levels = np.concatenate([stream.least[stream.least > 0.0] for stream in streams])
    if not len(levels):
        return None
    most = (0.0, 0)
    for share in np.geomspace(min(1.0, wanted / len(levels)), 1.0, 40):
        level = float(np.quantile(levels, 1.0 - share))
        episodes = count(level)
        if level > 0.0 and episodes > most[1]:
            most = (level, episodes)
        if episodes >= wanted:
            break
    return most


def _dispersion(onsets: Sequence[NDArray[np.intp]], lengths: Sequence[int]) -> float:
    """Index of dispersion of the counts of blocks, 1 where they are as even as chance or more."""
    block = max(1, sum(lengths) // BLOCKS)
    counts = [
        np.histogram(ticks, bins=np.arange(0, length + 1, block))[0]
        for ticks, length in zip(onsets, lengths, strict=True)
        if length >= block
    ]
    counted = np.concatenate(counts) if counts else np.zeros(1)
    if len(counted) < BLOCKS // 2 or not counted.mean() > 0.0:
        return 1.0
    return max(1.0, float(counted.var(ddof=1) / counted.mean()))


def _read_off(
    maxima: Callable[[float], list[Floats]],
    between: tuple[float, float],
    counted: tuple[float, float, float],
    alerts_per_week: float,
    hours: float,
) -> Threshold:
    """The lowest threshold from which on there are as many episodes as asked for, or fewer."""
    asked, weeks, bunched = counted
    threshold = _where(lambda level: sum(map(len, maxima(level))) <= asked, *between)
    episodes = sum(map(len, maxima(threshold)))
    low = float(gammaincinv(max(episodes / bunched, 1e-9), 0.5 - COVERAGE / 2)) * bunched / weeks
    high = float(gammaincinv(episodes / bunched + 1.0, 0.5 + COVERAGE / 2)) * bunched / weeks
    return Threshold(threshold, alerts_per_week, episodes / weeks, low, high, hours, False, episodes)


def _tail(maxima: Floats, base: float, weeks: float, bunched: float) -> _Tail:
    """The posterior of rate, scale and shape of the maxima above the base."""
    excess = np.maximum(maxima - base, 0.0)
    mean = max(float(excess.mean()), 1e-12)
    log_scales, shapes = (grid.ravel() for grid in np.meshgrid(math.log(mean) + LOG_SCALES, SHAPES, indexing="ij"))
    shapes = np.where(np.abs(shapes) < 1e-9, 1e-9, shapes)
    scales = np.exp(log_scales)
    inside = 1.0 + shapes[:, None] * excess[None, :] / scales[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        each = np.where(inside > 0.0, np.log(inside), np.nan)
    likelihood = -len(excess) * log_scales - (1.0 + 1.0 / shapes) * each.sum(axis=1)
    posterior = np.where(np.isnan(likelihood), -np.inf, likelihood / bunched) - 0.5 * (shapes / SHAPE_SD) ** 2
    weights = np.exp(posterior - posterior.max())
    counted = len(excess) / bunched
    rates = np.asarray(gammaincinv(counted + 0.5, RATE_QUANTILES), dtype=np.float64) * bunched / weeks
    kept = weights > 1e-6
    return _Tail(base, rates, scales[kept], shapes[kept], weights[kept] / weights[kept].sum())


def _where(is_enough: Callable[[float], bool], base: float, top: float) -> float:
    """The lowest level from the base on that is enough, to a ten-thousandth of the distance."""
    low, high = base, top + max(1e-9, 1e-6 * abs(top))
    if is_enough(low):
        return low
    while not is_enough(high):
        low, high = high, high + 2.0 * (high - base)
        if not math.isfinite(high):
            raise ModelError(f"no finite threshold gives so few alerts: scores above {base:.3g} have no end in sight")
    for _ in range(24):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if is_enough(middle) else (middle, high)
    return high
