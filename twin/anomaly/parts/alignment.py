"""Where a cut is in its operation when the control tells no line: progress since it began, put right by a banded online DTW.

    cost'(o) = (1 − forget) · min(cost(o), cost(o ± 1) + shift) + Σ min(|x − level(cell + o)| / spread, 4),   o = −band … band

Progress is the integral of the feed override while the feed is not 0: seconds as programmed (`progress_s`). Holds and overrides
do not shift it, and sampling once a second does not either; the integral of feed (mm) is off by metres after a few rapids. Where
the override is not told, or a part began elsewhere, the signals say so: the cell is that of the progress in the usual course, the
offset o is by how many cells that is wrong, and the offset of least cost is the place. The recursion is exact over the band, as
dynamic time warping over a band around the diagonal is; the diagonal is moved along where the best offset comes near the edge. It
takes a tick at a time and keeps 2 · band + 1 costs. The cost of a signal is capped, so a fault costs every offset the same and
shifts nothing.
"""

from bisect import bisect_right
from collections.abc import Sequence
from itertools import accumulate, pairwise
from typing import NamedTuple

BAND = 8
"""Cells that the progress may be wrong by, to either side, since the place was last put right."""
FORGET = 0.01
SHIFT = 4.0
"""Cost of one cell of offset, in spreads."""
STAY = 8.0
"""By so many spreads another offset has to be better before the place is put right: what tells little shifts nothing."""
COST_MAX = 4.0
CELLS_MAX = 20_000


class Course(NamedTuple):
    """The usual course of an operation.

    ends: progress at which each cell ends, ascending; levels: usual values, by signal and cell
    spreads: of a cell about its level, by signal; section_cells: how many make a section
    """

    ends: tuple[float, ...]
    levels: tuple[tuple[float, ...], ...]
    spreads: tuple[float, ...]
    section_cells: int = 4

    @property
    def sections(self) -> int:
        """Return the number of sections."""
        return -(-len(self.ends) // self.section_cells)


class Place(NamedTuple):
    """The place in an operation, as known so far.

    progress: since it began; cell: the one that it lies in; offset: by how many cells that is wrong
    centre: cells that the band was moved by; costs: by offset about it; sums, told: of the signals since the cell began
    """

    progress: float = 0.0
    cell: int = 0
    offset: int = 0
    centre: int = 0
    costs: tuple[float, ...] = (*(SHIFT * abs(offset) for offset in range(-BAND, BAND + 1)),)
    sums: tuple[float, ...] = ()
    told: tuple[int, ...] = ()


BEGUN = Place()


class Moved(NamedTuple):
    """One tick of an operation. moved: progress in it; values: by signal, None = not known"""

    moved: float
    values: tuple[float | None, ...]


def progress_s(feed_mm_min: float | None, feed_override_pct: float | None, tick_s: float) -> float:
    """Return the programmed seconds that pass in a tick; a feed or an override that is not told is taken to be as programmed.

    >>> progress_s(800.0, 50.0, 1.0), progress_s(0.0, 100.0, 1.0), progress_s(None, None, 1.0)
    (0.5, 0.0, 1.0)
    """
    if feed_mm_min is not None and feed_mm_min <= 0.0:
        return 0.0
    return tick_s * (1.0 if feed_override_pct is None else 0.01 * feed_override_pct)


def aligned(course: Course, place: Place, values: Sequence[float | None], moved: float) -> tuple[Place, int]:
    """Return the place after a tick, and the section that it lies in. moved: progress since the tick before.

    >>> steps = [Moved(1.0, (float(tick // 7 % 2),)) for tick in range(60)]
    >>> course, place = course_of(steps, spreads=(0.1,), section_cells=5), BEGUN
    >>> for step in [Moved(1.0, (0.0,))] * 4 + steps[:29]:  # it began four ticks later than usual
    ...     place, section = aligned(course, place, step.values, step.moved)
    >>> section, by_progress(course, 33.0)
    (5, 6)
    """
    if moved <= 0.0:
        return place, section_of(course, place)
    sums, told = place.sums or (0.0,) * len(values), place.told or (0,) * len(values)
    sums = tuple([total if value is None else total + value for total, value in zip(sums, values, strict=True)])
    told = tuple([count + (value is not None) for count, value in zip(told, values, strict=True)])
    progress = place.progress + moved
    cell = bisect_right(course.ends, progress, place.cell)
    place = Place(progress, place.cell, place.offset, place.centre, place.costs, sums, told)
    if cell > place.cell:
        place = _corrected(course, place)._replace(cell=cell, sums=(), told=())
    return place, section_of(course, place)


def section_of(course: Course, place: Place) -> int:
    """Return the section of a place."""
    return min(max(place.cell + place.offset, 0), len(course.ends) - 1) // course.section_cells


def by_progress(course: Course, progress: float) -> int:
    """Return the section in which a progress since the operation began lies, with nothing put right."""
    return min(bisect_right(course.ends, progress), len(course.ends) - 1) // course.section_cells


def _corrected(course: Course, place: Place) -> Place:
    """Return the place with the signals of the cell that has ended taken into account."""
    means = [total / count if count else None for total, count in zip(place.sums, place.told, strict=True)]
    costs = _told(course, place.cell + place.centre, _moved_on(place.costs), means)
    now, best = place.offset - place.centre, costs.index(min(costs)) - BAND
    if costs[now + BAND] < costs[best + BAND] + STAY:
        best = now
    if abs(best) > BAND // 2:
        return place._replace(costs=_recentred(costs, best), centre=place.centre + best, offset=place.centre + best)
    return place._replace(costs=costs, offset=place.centre + best)


def _moved_on(costs: Sequence[float]) -> list[float]:
    """Return the costs after a step: an offset stays, or comes from beside it at a price."""
    keep, none = 1.0 - FORGET, float("inf")
    before, after = (none, *costs[:-1]), (*costs[1:], none)
    return [keep * min(here, left + SHIFT, right + SHIFT) for here, left, right in zip(costs, before, after, strict=True)]


def _told(course: Course, cell: int, costs: list[float], values: Sequence[float | None]) -> tuple[float, ...]:
    """Return the costs with those of a cell added, the least of them 0."""
    first, last = cell - BAND, len(course.ends) - 1
    is_within = first >= 0 and cell + BAND <= last
    for value, levels, spread in zip(values, course.levels, course.spreads, strict=True):
        if value is None or not spread:
            continue
        if is_within:
            beside: Sequence[float] = levels[first : cell + BAND + 1]
        else:
            beside = [levels[min(max(first + at, 0), last)] for at in range(len(costs))]
        most, per = COST_MAX, 1.0 / spread
        costs = [
            cost + (apart if (apart := abs(value - level) * per) < most else most)
            for cost, level in zip(costs, beside, strict=True)
        ]
    least = min(costs)
    return tuple([cost - least for cost in costs])


def _recentred(costs: tuple[float, ...], best: int) -> tuple[float, ...]:
    """Return the costs about another offset; those that come into the band cost what the way to them does."""
    if best > 0:
        return (*costs[best:], *(costs[-1] + SHIFT * more for more in range(1, best + 1)))
    return (*(costs[0] + SHIFT * more for more in range(-best, 0, -1)), *costs[:best])


def course_of(
    part: Sequence[Moved], *, spreads: Sequence[float] | None = None, cell_ticks: int = 1, section_cells: int = 4
) -> Course:
    """Return the usual course of an operation from its ticks in one part: a cell for every `cell_ticks` that moved.

    One part is sharper than the mean of several. `spreads` are taken from it where they are not given. Raises ValueError where
    nothing moved.
    """
    moving = [tick for tick in part if tick.moved > 0.0]
    if not moving:
        raise ValueError("an operation in which nothing moved has no course; give ticks with moved > 0")
    cell_ticks = max(cell_ticks, -(-len(moving) // CELLS_MAX))
    groups = [moving[at : at + cell_ticks] for at in range(0, len(moving), cell_ticks)]
    ends = tuple(accumulate(sum(tick.moved for tick in group) for group in groups))
    levels = _filled([_means(group) for group in groups])
    return Course(ends, levels, tuple(spreads or _spreads(levels)), section_cells)


def _means(ticks: Sequence[Moved]) -> list[float | None]:
    """Return the mean of each signal where it is known."""
    known = [[value for value in column if value is not None] for column in zip(*(tick.values for tick in ticks), strict=True)]
    return [sum(column) / len(column) if column else None for column in known]


def _filled(rows: Sequence[Sequence[float | None]]) -> tuple[tuple[float, ...], ...]:
    """Return the values by signal; where one is missing, the last one that was known, before it the first one, or else 0."""
    columns = []
    for column in zip(*rows, strict=True):
        known = next((value for value in column if value is not None), 0.0)
        columns.append(tuple([known := known if value is None else value for value in column]))
    return tuple(columns)


def _spreads(levels: Sequence[Sequence[float]]) -> list[float]:
    """Return the spread of each signal: its mean change from cell to cell, and a twentieth of its range where that is larger."""
    found = []
    for column in levels:
        steps = [abs(after - before) for before, after in pairwise(column)]
        found.append(max(sum(steps) / len(steps), 0.05 * (max(column) - min(column))) if steps else 0.0)
    return found
