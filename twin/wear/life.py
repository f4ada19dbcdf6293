"""The lives of a tool: how each ended, and what that says of the next one.

A life that began at a replacement and ended at one gives its length T in parts, the level R at its end, and its curve. Of L lives

    log T ~ N(mean, s²),   s² = (K·k² + Σ (log T − mean)²) / (K + L − 1) · (1 + 1/L)

with K lives' worth of the usual spread k, and log R likewise: the predictive spread of a normal with an inverse-gamma prior
(Gelman et al., Bayesian Data Analysis, 3rd ed., section 3.3). The mean is the median, and a deviation counts as at most FAR
usual spreads, since a replacement that was not seen makes two lives one.
"""

from collections.abc import Sequence
from math import exp, log, sqrt
from statistics import median
from typing import NamedTuple

from twin.wear.curve import KNOTS, LINE, Curve, mean_curve

LIVES_MAX = 8
LIVES_MIN = 2
BINS_MAX = 24
USUAL_LIVES, LENGTH_SPREAD, END_SPREAD = 2.0, 0.3, 0.2
END_SHARE = 0.15
FAR = 2.0
USES_OF_A_LIFE_MIN = 6


class Course(NamedTuple):
    """The levels of a life that runs, as means over `width` uses each; when all bins are full, each two become one."""

    width: int = 1
    uses: int = 0
    sums: tuple[float, ...] = ()
    counts: tuple[int, ...] = ()


class Life(NamedTuple):
    """A life that has ended: its length in uses, its level at the end, and its levels at the knots of the curve."""

    uses: int
    end: float
    levels: tuple[float, ...]


class Known(NamedTuple):
    """The sum of what is known of a tool's lives: level at the end, its log spread, uses, their log spread; the curve."""

    end: float
    end_spread: float
    uses: float
    uses_spread: float
    curve: Curve
    lives: int


def followed(course: Course, use: int, level: float) -> Course:
    """Return the course with the level at a use (0 is the first)."""
    width, sums, counts = course.width, list(course.sums), list(course.counts)
    while use // width >= BINS_MAX:
        sums = [sum(sums[place : place + 2]) for place in range(0, len(sums), 2)]
        counts = [sum(counts[place : place + 2]) for place in range(0, len(counts), 2)]
        width *= 2
    place = use // width
    missing = place + 1 - len(sums)
    sums += [0.0] * missing
    counts += [0] * missing
    sums[place] += level
    counts[place] += 1
    return Course(width, use + 1, tuple(sums), tuple(counts))


def ended(course: Course) -> Life | None:
    """Return the life whose course has ended; None where too little of it was seen, or it did not rise."""
    points = [
        ((place + 0.5) * course.width, total / count, count)
        for place, (total, count) in enumerate(zip(course.sums, course.counts, strict=True))
        if count
    ]
    if course.uses < USES_OF_A_LIFE_MIN or len(points) < 4:
        return None
    tail = [point for point in points if point[0] >= (1.0 - END_SHARE) * course.uses] or points[-1:]
    count = sum(point[2] for point in tail)
    mean, at = sum(p[1] * p[2] for p in tail) / count, sum(p[0] * p[2] for p in tail) / count
    rise = max((mean - points[0][1]) / max(at - points[0][0], 1.0), 0.0)
    end = mean + rise * (course.uses - at)
    if end <= 0.0:
        return None
    levels = [_level(points, course.uses * knot / KNOTS) for knot in range(1, KNOTS)]
    return Life(course.uses, end, (0.0, *levels, end))


def _level(points: Sequence[tuple[float, float, int]], use: float) -> float:
    """Return the level at a use, between the two points beside it, each point the mean of itself and its neighbours."""
    before = [point for point in points if point[0] <= use][-2:]
    after = [point for point in points if point[0] > use][:2]
    near = before + after
    weight = sum(point[2] for point in near)
    middle = sum(point[0] * point[2] for point in near) / weight
    mean = sum(point[1] * point[2] for point in near) / weight
    spread = sum(point[2] * (point[0] - middle) ** 2 for point in near)
    slope = sum(point[2] * (point[0] - middle) * (point[1] - mean) for point in near) / spread if spread > 0.0 else 0.0
    return mean + slope * (use - middle)


def known(lives: Sequence[Life], limit: float | None) -> Known | None:
    """Return what earlier lives say of the next one, else what the configured limit does; None where neither is known."""
    if len(lives) < LIVES_MIN:
        return None if limit is None else Known(limit, 0.0, 0.0, 0.0, LINE, len(lives))
    end, end_spread = pooled([log(life.end) for life in lives], END_SPREAD)
    uses, uses_spread = pooled([log(life.uses) for life in lives], LENGTH_SPREAD)
    return Known(exp(end), end_spread, exp(uses), uses_spread, mean_curve([life.levels for life in lives]), len(lives))


def pooled(values: Sequence[float], usual: float) -> tuple[float, float]:
    """Return the middle of values and the spread of the next one, by the equation above; usual: k."""
    count = len(values)
    mean = median(values)
    squares = USUAL_LIVES * usual**2 + sum(min(abs(value - mean), FAR * usual) ** 2 for value in values)
    return mean, sqrt(squares / (USUAL_LIVES + count - 1.0) * (1.0 + 1.0 / count))
