"""The place in an operation where the control tells no line: progress since it began, put right by a banded online DTW.

    cost'(o) = (1 − forget) · min(cost(o), cost(o ± 1) + shift) + Σ min(|x − centre(progress + o)| · weight(progress + o), 4)

Progress is the integral of the feed override while the feed is not 0: seconds as programmed. Holds and overrides do not shift
it, nor does sampling once a second; the integral of feed, in mm, is off by metres after a few rapids. An override that is not
told, or a late start, shows in the signals: o = −band … band are the seconds by which progress may be wrong, centre and
weight those of the section there (`usual.py`), x the quantities of the tick. The recursion is exact over the band, as that of
dynamic time warping over a band around the diagonal is. Where the best offset is better than none by `STAY`, progress is put
right and the band goes along. The cost of a signal is capped, so a fault costs every offset the same and shifts nothing; an
edge has little weight.
"""

from collections.abc import Sequence

from twin.anomaly.parts.moment import NO_LINE, section_at
from twin.anomaly.parts.usual import Usual

CELL_S = 1.0
BAND = 8
FORGET = 0.01
SHIFT = 4.0
"""Cost of one second of offset, in spreads."""
STAY = 8.0
"""By so many spreads another offset has to be better before progress is put right: what tells little shifts nothing."""
COST_MAX = 4.0
Costs = tuple[float, ...]
"""By offset, −BAND to BAND cells; () = nothing was told yet."""
_BEGUN: Costs = (*(SHIFT * abs(offset) for offset in range(-BAND, BAND + 1)),)


def put_right(
    usual: Usual, costs: Costs, progress_s: float, values: Sequence[float | None], cell_s: float = CELL_S
) -> tuple[Costs, float]:
    """Return the costs after a cell, and the seconds by which progress is to be moved; values: quantities, None = not told.

    >>> from twin.anomaly.parts.usual import begun_usual
    >>> usual = begun_usual(((-1, 0.0), (-1, 20.0), (-1, 30.0)), (-1, 60.0), 1)
    >>> usual = usual._replace(centre=((1.0,), (2.0,), (1.0,)), weight=((5.0,),) * 3)
    >>> costs, shift_s = (), 0.0
    >>> for second in range(60):  # the cut at 20 s comes four seconds late, so progress is too large
    ...     costs, more_s = put_right(usual, costs, second + shift_s, (2.0 if 24 <= second < 34 else 1.0,))
    ...     shift_s += more_s
    >>> shift_s
    -4.0
    """
    beside: dict[int, float] = {}
    added = []
    for offset in range(-BAND, BAND + 1):
        section = section_at(usual.marks, NO_LINE, progress_s + offset * cell_s)
        cost = beside.get(section)
        if cost is None:
            cost = beside[section] = _apart(usual.centre[section], usual.weight[section], values)
        added.append(cost)
    costs = _after(costs or _BEGUN, added)
    best = costs.index(min(costs)) - BAND
    if best == 0 or costs[BAND] < costs[best + BAND] + STAY:
        return costs, 0.0
    return _recentred(costs, best), best * cell_s


def _apart(centre: Sequence[float], weight: Sequence[float], values: Sequence[float | None]) -> float:
    """Return how far a tick is from a section, in spreads; a signal that is not told counts nothing."""
    total = 0.0
    for middle, per, value in zip(centre, weight, values, strict=True):
        if value is not None:
            apart = (value - middle) * per
            total += min(apart if apart > 0.0 else -apart, COST_MAX)
    return total


def _after(costs: Costs, added: Sequence[float]) -> Costs:
    """Return the costs after a cell, the least of them 0: an offset stays, or comes from beside it at a price."""
    keep, none = 1.0 - FORGET, float("inf")
    before, after = (none, *costs[:-1]), (*costs[1:], none)
    ways = zip(costs, before, after, added, strict=True)
    found = [keep * min(here, left + SHIFT, right + SHIFT) + cost for here, left, right, cost in ways]
    least = min(found)
    return tuple([cost - least for cost in found])


def _recentred(costs: Costs, best: int) -> Costs:
    """Return the costs about another offset; those that come into the band cost what the way to them does."""
    if best > 0:
        return (*costs[best:], *(costs[-1] + SHIFT * more for more in range(1, best + 1)))
    return (*(costs[0] + SHIFT * more for more in range(-best, 0, -1)), *costs[:best])
