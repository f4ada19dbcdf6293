"""The times at which a recording was sampled, in ticks of the servo loops, and its series carried from there to the ticks.

Stamps are taken for what they say where that is plausible. Even ones tell the sample period p; where p is a whole number of ticks
to within CLOCK, the samples are taken to lie on ticks, and the rest to be another clock. Stamps that jitter are either true, then
a motion is smooth over them, or the recorder was late to write them, then it is smooth over the number of the sample.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from twin.runlog import AXIS_COLUMN, RunLog

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
CLOCK = 0.03
"""Part by which a sample period may be off a whole number of ticks and be the same by another clock."""
ANOTHER_CLOCK = 0.002
"""Part from which on that is mentioned."""
UNEVEN = 1e-3
"""Ticks by which an even stamp may be off."""
JITTER = 0.2
"""Sample periods, or ticks, by which a stamp may be off without being mentioned."""
SHAKEN_MAX = 5.0
"""Sample periods by which the stamps of a recording without gaps may be off."""
BLOCK = 100
TRUER = 0.5
"""Roughness of a motion over its stamps, against that over the numbers of its samples, below which the stamps are true."""
NEAR = 1e-6
"""Ticks by which a sample may be off a tick and be on it."""
DOUBT_MM, RESOLUTION_MM_MAX = 3e-4, 3e-3
"""Distances that a position may be off for what its reference did between samples, and that its resolution may add."""
FORGOTTEN = 4.0
"""Time constants of a position loop after which it has forgotten what it was told."""
HOLE = 2.5
"""Sample periods beyond which neighbouring samples say nothing of what was between them."""


@dataclass(frozen=True, eq=False)
class SampleTimes:
    """The times of the samples of a recording. at: (n,) in ticks, from 0 on; every: ticks a sample; notes: what was found"""

    at: Floats
    every: float
    notes: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        """Ticks of the whole recording."""
        return int(np.floor(self.at[-1] + NEAR)) + 1

    @property
    def one_a_tick(self) -> bool:
        """Return True where the samples are those of the ticks, whether or not some are missing."""
        return self.every == 1.0 and bool((np.abs(self.at - np.round(self.at)) < NEAR).all())

    @cached_property
    def _tick(self) -> Ints:
        """The tick nearest to each sample, (n,)."""
        return np.asarray(np.minimum(np.round(self.at), self.count - 1), dtype=np.intp)

    def interpolated(self, values: Floats) -> Floats:
        """A smooth series at every tick: by a cubic spline, still where it was still, and straight over a hole."""
        known = np.isfinite(values)
        at, values = self.at[known], values[known]
        ticks = np.arange(self.count, dtype=np.float64)
        straight = np.interp(ticks, at, values)
        if len(at) < 4 or self.one_a_tick:
            return straight
        smooth = np.asarray(CubicSpline(at, values)(ticks))
        before = np.clip(np.searchsorted(at, ticks + NEAR, side="right") - 1, 0, len(at) - 2)
        on_sample = np.abs(ticks - at[before]) < NEAR
        plain = on_sample | (values[before] == values[before + 1]) | (np.diff(at)[before] > HOLE * max(self.every, 1.0))
        return np.where(plain | (ticks > at[-1]), straight, smooth)

    def in_doubt(self, values: Floats, gain_per_s: float, period_s: float) -> NDArray[np.bool_]:
        """Ticks at which a loop still feels that its reference, `values`, is not known well enough between samples, (count,).

        A sample is foretold from every second one beside it. An interpolation between all of them is off by a half of that
        where the velocity jumps, by less where it does not; a position loop of gain K_p makes a quarter of K_p T of it.
        """
        known = np.isfinite(values)
        at, values = self.at[known], values[known]
        doubt = np.zeros(self.count, dtype=bool)
        if self.every <= 1.0 or len(values) < 8:
            return doubt
        off = np.abs(9.0 * (values[2:-4] + values[4:-2]) - values[:-6] - values[6:] - 16.0 * values[3:-3]) / 16.0
        off = 0.5 * np.maximum(off - min(3.0 * float(np.median(off)), RESOLUTION_MM_MAX), 0.0)
        felt = np.flatnonzero(0.25 * gain_per_s * self.every * period_s * off > DOUBT_MM) + 3
        for sample in felt:
            begin, end = at[sample - 1], at[sample + 1] + FORGOTTEN / gain_per_s / period_s
            doubt[int(begin) + 1 : int(end)] = True
        return doubt

    def carried(self, values: Floats) -> Floats:
        """A smooth and noisy series at the ticks nearest to its samples: moved there along a cubic through its neighbours."""
        known = np.flatnonzero(np.isfinite(values))
        column = np.full(self.count, np.nan)
        place, off = self._tick[known], self.at[known] - self._tick[known]
        if bool((np.abs(off) < NEAR).all()):
            column[place] = values[known]
            return column
        nearest = known[np.lexsort((-np.abs(off), place))]  # of several at one tick the nearest comes last, and stays
        moved = self._moved(values, known)
        column[self._tick[nearest]] = moved[np.searchsorted(known, nearest)]
        return column

    def _moved(self, values: Floats, known: Ints) -> Floats:
        """The known values at the ticks nearest to them, NaN beside a hole."""
        at, tick, series = self.at[known], self._tick[known].astype(np.float64), values[known]
        if len(known) < 4:
            return np.where(np.abs(at - tick) < NEAR, series, np.nan)
        first = np.clip(np.arange(len(known)) - np.where(tick >= at, 1, 2), 0, len(known) - 4)
        four = first[:, None] + np.arange(4)
        x, y = at[four] - tick[:, None], series[four]
        moved = np.zeros(len(known))
        for i in range(4):  # Lagrange
            others = [j for j in range(4) if j != i]
            moved += y[:, i] * np.prod([-x[:, j] / (x[:, i] - x[:, j]) for j in others], axis=0)
        whole = np.diff(at[four], axis=1).max(axis=1) <= HOLE * max(self.every, 1.0)
        on_tick = np.abs(at - tick) < NEAR
        return np.where(on_tick, series, np.where(whole, moved, np.nan))

    def held(self, values: Floats) -> Floats:
        """A series that the loops hold from tick to tick, at the tick before each sample: the mean where there are several."""
        known = np.isfinite(values)
        tick = np.floor(self.at[known] + NEAR).astype(np.intp)
        count = np.bincount(tick, minlength=self.count)
        with np.errstate(invalid="ignore"):
            return np.asarray(np.bincount(tick, weights=values[known], minlength=self.count) / count)

    def nearest(self, values: Floats) -> Floats:
        """A series that is neither smooth nor held, at the ticks nearest to its samples, as it was recorded."""
        known = np.flatnonzero(np.isfinite(values))
        column = np.full(self.count, np.nan)
        by_distance = known[np.argsort(-np.abs(self.at[known] - self._tick[known]), kind="stable")]
        column[self._tick[by_distance]] = values[by_distance]
        return column

    def last(self, values: Floats) -> Floats:
        """A series that keeps its value until the next sample, at every tick."""
        last = np.searchsorted(self._tick, np.arange(self.count), side="right") - 1
        return np.asarray(values[np.clip(last, 0, len(values) - 1)])


def sample_times(log: RunLog, period_s: float) -> SampleTimes:
    """The times at which the samples of a recording of at least two were taken, in ticks of `period_s` since the first."""
    t_s = log.t_s - log.t_s[0]
    steps = np.diff(t_s)
    middle_s = float(np.median(steps))
    off_s = float(np.abs(steps - middle_s).max())
    missing = off_s > JITTER * middle_s and _missing_any(t_s)
    number = np.arange(len(t_s), dtype=np.float64)
    if missing:
        every, _ = _every(middle_s, period_s)
        number = np.round(t_s / (every * period_s)) if every.is_integer() else np.cumsum([0.0, *np.round(steps / middle_s)])
    sample_s = float(t_s[-1] / max(number[-1], 1.0))
    every, notes = _every(sample_s, period_s)
    uneven_s = float(np.abs(t_s - number * sample_s).max())
    own = uneven_s > UNEVEN * period_s and _stamps_are_true(log, number)
    if own:
        said = (
            f"is sampled every {1000 * sample_s:.4g} ms, uneven by up to {1000 * uneven_s:.2g} ms: each at the time of its stamp"
        )
        every, notes = sample_s / period_s, (said,)
    gaps = round(float(number[-1])) + 1 - len(np.unique(number))
    if gaps > 0:
        notes += (f"has gaps, {gaps} samples are missing; the reference is interpolated there and nothing compared",)
    if own:
        return SampleTimes(t_s / period_s, every, notes)
    if uneven_s > JITTER * period_s and not missing:
        said = f"its time stamps jitter by up to {1000 * uneven_s:.2g} ms; its samples are taken to be {_a_tick(every)}"
        notes += (said,)
    return SampleTimes(number * every, every, notes)


def _every(sample_s: float, period_s: float) -> tuple[float, tuple[str, ...]]:
    """Ticks from sample to sample, a whole number of them where that can be meant, and what to say of it."""
    ratio = sample_s / period_s
    whole = max(round(ratio), 1)
    said = f"is sampled every {1000 * sample_s:.5g} ms, the loops tick every {1000 * period_s:.5g} ms: "
    if abs(ratio / whole - 1.0) > CLOCK:
        how = (
            "of the samples at one tick the nearest is compared"
            if ratio < 1.0
            else "the twin is compared at the samples' own times"
        )
        return ratio, (said + how,)
    if abs(ratio / whole - 1.0) > ANOTHER_CLOCK:
        return float(whole), (f"{said}its clock is another one, and its samples are taken to be {_a_tick(whole)}",)
    if whole > 1:
        return float(whole), (
            f"{said}the twin is compared at one tick in {whole}, and the reference is interpolated between them",
        )
    return 1.0, ()


def _a_tick(every: float) -> str:
    return "one a tick" if every == 1.0 else f"one every {every:.4g} ticks"


def _missing_any(t_s: Floats) -> bool:
    """Return True where samples are missing, and not only stamped badly: then the stamps run ahead of the samples for good."""
    period_s = float(np.median(np.diff(t_s)))
    mean_s = float(t_s[-1]) / (len(t_s) - 1)
    if abs(mean_s / period_s - 1.0) < CLOCK:
        period_s = mean_s  # the median of steps that jitter is not their mean
    ahead = t_s / period_s - np.arange(len(t_s))
    blocks = [float(np.median(part)) for part in np.array_split(ahead, max(len(t_s) // BLOCK, 1))]
    return max(blocks) - min(blocks) > 0.5 or float(np.abs(ahead - np.median(ahead)).max()) > SHAKEN_MAX


def _stamps_are_true(log: RunLog, number: Floats) -> bool:
    """Return True where motions are smoother over the stamps than over the numbers of the samples."""
    over_stamps = over_numbers = 0.0
    for name, values in log.columns.items():
        match = AXIS_COLUMN.match(name)
        known = np.isfinite(values)
        if match and match[2] != "torque_a" and known.sum() > BLOCK:
            size = max(float(np.ptp(values[known])), 1e-12)
            over_stamps += _roughness(log.t_s[known], values[known]) / size
            over_numbers += _roughness(number[known], values[known]) / size
    return over_stamps < TRUER * over_numbers


def _roughness(at: Floats, values: Floats) -> float:
    """Root mean square by which samples are off the parabola through their neighbours, in the faster half of the motion."""
    x = [at[i : len(at) - 3 + i] - at[1 : len(at) - 2] for i in range(4)]
    y = [values[i : len(at) - 3 + i] for i in range(4)]
    seen = sum(y[i] * np.prod([(0.0 - x[j]) / (x[i] - x[j]) for j in (0, 2, 3) if j != i], axis=0) for i in (0, 2, 3))
    off = np.asarray(seen) - y[1]
    speed = np.abs(y[3] - y[0])
    moving = speed >= np.median(speed[speed > 0.0]) if (speed > 0.0).any() else np.ones(len(speed), dtype=bool)
    return float(np.sqrt(np.mean(off[moving] ** 2)))
