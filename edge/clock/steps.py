"""Steps: whether the last buckets of a window show that the clock was set, and from where to where.

The last buckets have to agree with each other and not with those before. What came one way proves less than a reading over a
round trip, so more buckets are asked of it.
"""

from typing import NamedTuple

from edge.clock.bounds import Bound, OneWay, above, agreed

STEP_BUCKETS = 3  # of readings that agree on another offset
STEP_WAY_BUCKETS = 6  # of what came one way


class Step(NamedTuple):
    """The offset before the clock was set, and after."""

    from_s: float
    to_s: float


def stepped(window: tuple[Bound, ...], at_s: float) -> tuple[tuple[Bound, ...], Step | None]:
    """The window, and the step if the last buckets say that the clock was set."""
    before, last = window[:-STEP_BUCKETS], window[-STEP_BUCKETS:]
    if not before:
        return window, None
    was, now = agreed(before, at_s), agreed(last, at_s)
    if now.number < STEP_BUCKETS or now.bound.meets(was.bound):
        return window, None
    return last, Step(was.bound.offset_s, now.bound.offset_s)


def way_stepped(window: tuple[OneWay, ...], at_s: float) -> tuple[tuple[OneWay, ...], Step | None]:
    """Do the same with what came one way."""
    before, last = window[:-STEP_WAY_BUCKETS], window[-STEP_WAY_BUCKETS:]
    if not before or not _is_steady(last):
        return window, None
    was, now = above(before, at_s), above(last, at_s)
    return (window, None) if now.meets(was) else (last, Step(was.low_s, now.low_s))


def _is_steady(ways: tuple[OneWay, ...]) -> bool:
    """Return True if they are enough, and no further apart than latencies are."""
    lows = [way.low_s for way in ways]
    return len(ways) == STEP_WAY_BUCKETS and max(lows) - min(lows) <= max(way.doubt_s for way in ways)
