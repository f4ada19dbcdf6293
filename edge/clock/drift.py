"""The drift of a clock: a robust line through bounds of its offset.

One bound a minute is kept, then every other one of them and one every two minutes, and so on, so that a day fits. The slope is
the median of the slopes of all pairs (Theil, 1950; Sen, 1968); it is told once the bounds themselves leave no more than
`KNOWN_PPM` of doubt: each pair of bounds allows slopes from (low2 - high1)/(t2 - t1) to (high2 - low1)/(t2 - t1), and a clock
of one rate is in all of these.
"""

from dataclasses import dataclass
from itertools import combinations
from statistics import median
from typing import NamedTuple

from edge.clock.bounds import Bound

FIRST_S = 60.0
POINTS_MAX = 64
POINTS_MIN = 5
KNOWN_PPM = 50.0


class Drift(NamedTuple):
    """Parts per million that the control's clock runs faster than the edge's, and how far that may be off."""

    ppm: float
    spread_ppm: float


@dataclass(frozen=True, slots=True)
class Series:
    """Bounds `every_s` apart or more, oldest first."""

    points: tuple[Bound, ...] = ()
    every_s: float = FIRST_S

    def taken(self, bound: Bound) -> "Series":
        """Return the series with one more bound, where it is due.

        >>> series = Series()
        >>> for minute in range(65):
        ...     series = series.taken(Bound(60.0 * minute, 0.0, 1.0))
        >>> len(series.points), series.every_s
        (33, 120.0)
        """
        if self.points and bound.at_s - self.points[-1].at_s < self.every_s:
            return self
        points = (*self.points, bound)
        if len(points) > POINTS_MAX:
            return Series(points[::2], 2.0 * self.every_s)
        return Series(points, self.every_s)

    def moved(self, by_s: float) -> "Series":
        """Return it moved `by_s`, for an edge whose own clock was set."""
        return Series(tuple(point.moved(by_s) for point in self.points), self.every_s)


def drift(series: Series) -> Drift | None:
    """The drift, where the bounds tell it.

    Two clocks that are read to the millisecond each minute and part by 3 ms in it:

    >>> drift(Series(tuple(Bound(60.0 * n, 0.003 * n, 0.003 * n + 0.001) for n in range(6))))
    Drift(ppm=50.0, spread_ppm=3.3)
    """
    points = series.points
    if len(points) < POINTS_MIN:
        return None
    slopes, low, high = list[float](), -float("inf"), float("inf")
    for first, second in combinations(points, 2):
        apart_s = second.at_s - first.at_s
        slopes.append((second.offset_s - first.offset_s) / apart_s)
        low = max(low, (second.low_s - first.high_s) / apart_s)
        high = min(high, (second.high_s - first.low_s) / apart_s)
    slope = median(slopes)
    if low <= high:
        slope = min(max(slope, low), high)
        doubt = max(high - slope, slope - low)
    else:
        doubt = _scatter(slopes, slope)
    return Drift(round(slope * 1e6, 1), round(doubt * 1e6, 1)) if doubt * 1e6 <= KNOWN_PPM else None


def _scatter(slopes: list[float], slope: float) -> float:
    """Return the doubt of a clock that does not run at one rate."""
    return median(abs(one - slope) for one in slopes)
