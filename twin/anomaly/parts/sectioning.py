"""An operation is cut into sections by its first part: stretches in which load and feed are steady, and the edges between them.

    edge:    the ticks on either side of a jump of a ln ratio by more than 0.25 (of the speed 0.01); parts are sampled at other
             moments, so an edge may fall a tick earlier or later in the next
    steady:  the ticks between two edges, up to ten seconds, whose ln ratios stay within 0.15 of the first (the speed 0.005)

An edge has a large spread, so what happens in it says little; a steady stretch has a small one. Where there would be more than 64
sections, neighbours are joined, the most alike first.
"""

from collections.abc import Sequence

from twin.anomaly.parts.moment import SECTIONS_MAX
from twin.anomaly.parts.quantity import Kind
from twin.anomaly.parts.usual import Sums

STEADY_S_MAX = 10.0
JUMP, EVEN = 0, 1
JUMPS = {Kind.LOAD: 0.25, Kind.FEED: 0.25, Kind.SPEED: 0.01}
STEADY = {Kind.LOAD: 0.15, Kind.FEED: 0.15, Kind.SPEED: 0.005}
Row = tuple[tuple[float | None, float, float], ...]
"""A ln ratio of each signal with its limits, of a jump and of what is steady."""


def starts_of(sums: Sequence[Sums | None], kinds: Sequence[int], tick_s: float, most: int = SECTIONS_MAX) -> list[int]:
    """Return where sections begin, as places in `sums`, the short stretches that the first part was followed in; None = untold.

    >>> def told(x): return Sums((1,), (x,), (x * x,))
    >>> starts_of([told(x) for x in (3.0, 3.0, 3.1, 3.0, 0.5, 3.0, 3.0, 3.1)], (int(Kind.LOAD),), 1.0)
    [0, 3, 6]
    """
    rows = _carried([None if one is None else _means(one, kinds) for one in sums])
    edges = [False] * len(rows)
    for at in range(1, len(rows)):
        if _differ(rows[at - 1], rows[at], JUMP):
            edges[at - 1] = edges[at] = True
    starts, begun_ticks, steady = [0], 0.0, rows[0] if rows else None
    for at in range(1, len(rows)):
        one = sums[at]
        begun_ticks += 1.0 if one is None else max(one.ticks)
        is_new = edges[at] != edges[at - 1]
        if not is_new and not edges[at]:
            is_new = _differ(steady, rows[at], EVEN) or begun_ticks * tick_s >= STEADY_S_MAX
        if is_new:
            starts.append(at)
            begun_ticks, steady = 0.0, rows[at]
        elif steady is None:
            steady = rows[at]
    while len(starts) > most:
        starts = [starts[0], *starts[1::2]] if len(starts) > 2 * most else _joined(starts, rows)
    return starts


def _means(one: Sums, kinds: Sequence[int]) -> Row:
    rows = zip(kinds, one.ticks, one.total, strict=True)
    known = [(Kind(kind), total / ticks) if ticks else (Kind(kind), None) for kind, ticks, total in rows]
    return tuple([(mean, JUMPS[kind], STEADY[kind]) for kind, mean in known if kind in JUMPS])


def _carried(rows: Sequence[Row | None]) -> list[Row | None]:
    """Return the rows in which what is not told is as it was last: a speed that changes is told again once it has settled."""
    found: list[Row | None] = []
    last: Row | None = None
    for row in rows:
        if row is not None:
            held = row if last is None else last
            last = tuple([now if now[0] is not None else (old[0], now[1], now[2]) for now, old in zip(row, held, strict=True)])
        found.append(last)
    return found


def _differ(one: Row | None, other: Row | None, limit: int) -> bool:
    """Return True where a ln ratio differs by more than its limit."""
    if one is None or other is None:
        return False
    for (a, *limits), (b, *_) in zip(one, other, strict=True):
        if a is not None and b is not None and abs(a - b) > limits[limit]:
            return True
    return False


def _joined(starts: list[int], rows: Sequence[Row | None]) -> list[int]:
    """Return the starts with one less: that at which the rows on either side are most alike, in jumps."""

    def step(place: int) -> float:
        before, after = rows[starts[place] - 1], rows[starts[place]]
        if before is None or after is None:
            return 0.0
        pairs = zip(before, after, strict=True)
        return max([abs(a[0] - b[0]) / a[1] for a, b in pairs if a[0] is not None and b[0] is not None], default=0.0)

    least = min(range(1, len(starts)), key=step)
    return [start for place, start in enumerate(starts) if place != least]
