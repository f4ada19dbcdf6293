"""The offset of the control's clock by the signals: when it says that the spindle changed, and when a sensor of the edge saw it.

Over windows of 120 s the change of the control's spindle speed is correlated with the envelope of an edge-side sensor (current,
vibration), for offsets around one that is roughly known: the amount of the change with the envelope (current rises while a
spindle accelerates) and the change with that of the envelope (vibration follows the speed); the higher coefficient counts. A
window without an edge in the speed says nothing, one whose best coefficient is not above `QUALITY_MIN` is left out, and the
offset is the median of the last windows.

A control that is polled shows a change late, by half a poll on average: with `poll_s` known the change is spread over the poll
before, which takes that out; with 0 it is the sample-and-hold of the plain method. Either way errors reach half a second
(docs/explanation/clocks.md has the table), and that is the least that the bound claims: good for an alarm at one second, not for
100 ms.
"""

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from operator import mul, sub
from statistics import median
from typing import NamedTuple

from edge.clock.bounds import Bound
from edge.sample import EdgeSample

WINDOW_S = 120.0
SEARCH_S = 5.0
GRID_S = 0.1
QUALITY_MIN = 0.3
ERROR_S_MIN = 0.6
WINDOWS_KEPT = 7
POINTS_MAX = 4096
Points = tuple[tuple[float, float], ...]
"""Time in seconds, and value; times rise."""


class Peak(NamedTuple):
    """The offset at which both agree best, and the coefficient of correlation there."""

    offset_s: float
    quality: float


@dataclass(frozen=True, slots=True)
class State:
    """Speeds by the control's clock, envelope by the edge's, and the offsets of the last windows that were usable."""

    speed: Points = ()
    envelope: Points = ()
    offsets_s: tuple[float, ...] = ()


class News(NamedTuple):
    """Points that came since the last look."""

    speed: Points = ()
    envelope: Points = ()


def speed_of(samples: Iterable[EdgeSample]) -> Points:
    """The control's spindle speeds of a frame, by its own stamps.

    >>> speed_of([EdgeSample("spindle_rpm", 1200.0, 5_000), EdgeSample("tool_number", 7, 5_000)])
    ((5.0, 1200.0),)
    """
    speeds = (one for one in samples if one.signal == "spindle_rpm" and not one.is_baseline)
    return tuple((one.timestamp_ms / 1000.0, float(one.value)) for one in speeds if isinstance(one.value, int | float))


def step(state: State, news: News, *, at_s: float, around_s: float, poll_s: float) -> tuple[State, Bound | None]:
    """Take points in; compare when a window is full.

    at_s: the edge's monotonic time, for the bound; around_s: the offset as it is roughly known
    """
    speed, envelope = (*state.speed, *news.speed)[-POINTS_MAX:], (*state.envelope, *news.envelope)[-POINTS_MAX:]
    state = replace(state, speed=speed, envelope=envelope)
    if not state.envelope or state.envelope[-1][0] - state.envelope[0][0] < WINDOW_S + 2.0 * SEARCH_S:
        return state, None
    from_s = state.envelope[0][0] + SEARCH_S + around_s
    found = compare(state.speed, state.envelope, from_s=from_s, around_s=around_s, poll_s=poll_s)
    kept = tuple(point for point in state.envelope if point[0] >= state.envelope[-1][0] - 2.0 * SEARCH_S)
    before = max(bisect_right(state.speed, (from_s + WINDOW_S - SEARCH_S, math.inf)) - 1, 0)
    state = replace(state, envelope=kept, speed=state.speed[before:])
    if found is None or found.quality <= QUALITY_MIN:
        return state, None
    offsets_s = (*state.offsets_s, found.offset_s)[-WINDOWS_KEPT:]
    middle_s = median(offsets_s)
    error_s = max(ERROR_S_MIN, *(abs(one - middle_s) for one in offsets_s))
    return replace(state, offsets_s=offsets_s), Bound(at_s, middle_s - error_s, middle_s + error_s)


def compare(speed: Points, envelope: Points, *, from_s: float, around_s: float, poll_s: float) -> Peak | None:
    """The best offset of the window that begins at `from_s` of the control's clock; None where nothing changed in it."""
    count, search = round(WINDOW_S / GRID_S), round(SEARCH_S / GRID_S)
    shown = _on_grid(_ramps(speed, poll_s), from_s, count + 1)
    changes = list(map(sub, shown[1:], shown))
    if len(envelope) < 2 or not any(changes):
        return None
    seen = _on_grid(envelope, from_s - around_s - SEARCH_S, count + 2 * search + 1)
    between = [(left + right) / 2.0 for left, right in pairwise(seen)]
    amount = _coefficients(list(map(abs, changes)), between)
    signed = _coefficients(changes, list(map(sub, seen[1:], seen)))
    best = max((amount, signed), key=max)
    place = max(range(len(best)), key=best.__getitem__)
    # `best[place]` compares the control's t with the edge's t - around - search + place.
    return Peak(around_s + SEARCH_S - GRID_S * (place + _vertex(best, place)), best[place])


def _ramps(speed: Points, poll_s: float) -> Points:
    """Each change as a ramp over the poll before the control showed it; over a thousandth of a second where no poll is known."""
    knots = list[tuple[float, float]]()
    for number, (at_s, value) in enumerate(speed):
        if number:
            before_s, before = speed[number - 1]
            if at_s <= before_s:
                continue
            knots.append((max(before_s + 1e-6, at_s - max(poll_s, 1e-3)), before))
        knots.append((at_s, value))
    return tuple(knots)


def _on_grid(points: Points, from_s: float, count: int) -> list[float]:
    """The values at `count` moments of the grid, on straight lines between the points."""
    values, place, last = list[float](), 0, len(points) - 1
    if last < 0:
        return [0.0] * count
    for number in range(count):
        at_s = from_s + GRID_S * number
        while place < last and points[place + 1][0] <= at_s:
            place += 1
        (left_s, left) = points[place]
        if at_s <= left_s or place == last:
            values.append(left)
            continue
        right_s, right = points[place + 1]
        values.append(left + (right - left) * (at_s - left_s) / (right_s - left_s))
    return values


def _coefficients(short: Sequence[float], long: Sequence[float]) -> list[float]:
    """Pearson's coefficient of `short` with each stretch of `long` of its length; 0 where a stretch is flat."""
    count = len(short)
    mean = sum(short) / count
    off = [value - mean for value in short]
    power = math.sqrt(sum(map(mul, off, off)))
    level = sum(long) / len(long)
    even = [value - level for value in long]
    sums, squares = [0.0, *accumulate(even)], [0.0, *accumulate(map(mul, even, even))]
    found = list[float]()
    for place in range(len(long) - count + 1):
        total = sums[place + count] - sums[place]
        spread = squares[place + count] - squares[place] - total * total / count
        product = sum(map(mul, off, even[place : place + count]))
        found.append(product / (power * math.sqrt(spread)) if spread > 1e-12 * (squares[-1] or 1.0) and power > 0.0 else 0.0)
    return found


def _vertex(values: Sequence[float], place: int) -> float:
    """Return where the parabola through a peak and its neighbours has its top, in steps from the peak."""
    if not 0 < place < len(values) - 1:
        return 0.0
    left, top, right = values[place - 1], values[place], values[place + 1]
    bend = left - 2.0 * top + right
    return 0.0 if bend >= 0.0 else 0.5 * (left - right) / bend
