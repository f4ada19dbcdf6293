"""The place of the transient in a captured window, with its beginning and its end.

Activity is how far the level moves within half a second, less what it moves in the quieter half of the window: noise. The
transient lies where nearly all activity does; its beginning and its end are parted by the time in which least happens for how
long it is: what moves there (a spindle that is turned to its position, a magazine) belongs to neither.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.transient.errors import TransientError

Floats = NDArray[np.float64]

SMOOTHED_S = 0.5
OUTSIDE = 0.02
"""Share of the activity that may lie before the transient, and after it."""
SIDE = 0.1
"""Share that beginning and end have at least, each."""
MARGIN = 0.08
"""Part of the transient's length by which beginning and end reach beyond their activity on each side."""

FLAT = 0.25
"""A beginning or end that deviates by less than this share of the whole is none."""


@dataclass(frozen=True, slots=True)
class Parts:
    """Samples of a window: the transient is [first, last), its beginning ends at `begun`, its end begins at `ending`."""

    first: int
    begun: int
    ending: int
    last: int


def activity(values: Floats, period_s: float) -> Floats:
    """Return the activity in a window of levels, (n,)."""
    width = max(1, round(SMOOTHED_S / period_s))
    padded = np.pad(values, width, mode="edge")
    smooth = np.convolve(padded, np.ones(width) / width, mode="same")
    ahead, behind = width - width // 2, width // 2
    moved = np.abs(smooth[width + ahead : len(padded) - width + ahead] - smooth[width - behind : len(padded) - width - behind])
    return np.asarray(np.maximum(0.0, moved - 2.5 * np.median(moved)))


def parts_of(values: Floats, period_s: float) -> Parts:
    """The parts of the transient in a captured window. Raises TransientError where nothing moves in it, or all of it at once."""
    moves = activity(values, period_s)
    total = moves.sum()
    if total <= 0.0:
        raise TransientError("nothing moves in a captured window: give the time of the change, or another signal")
    share = np.cumsum(moves) / total
    first, last = int(np.searchsorted(share, OUTSIDE)), int(np.searchsorted(share, 1.0 - OUTSIDE))
    begun, ending = _quiet(share, first, last)
    length = last - first
    margin = max(2, round(MARGIN * length))
    first, last = max(0, first - margin), min(len(values), last + margin + 1)
    room = max(0, ending - begun) // 2
    begun, ending = begun + min(margin, room), ending - min(margin, room)
    least = FLAT * float(values[first:last].std())
    if begun - first < 3 or last - ending < 3 or min(values[first:begun].std(), values[ending:last].std()) < least:
        raise TransientError(
            f"a captured transient of {length * period_s:.3g} s has no beginning and end that can be told apart: sample finer "
            f"than every {period_s:g} s, or give a window that holds it alone"
        )
    return Parts(first, begun, ending, last)


def _quiet(share: Floats, first: int, last: int) -> tuple[int, int]:
    """The stretch whose share of the time exceeds its share of the activity by most, with a tenth of that on either side."""
    best, quietest, start = (first, first), np.inf, first
    gain = 0.0
    for n in range(first, last):
        if not SIDE <= share[n] <= 1.0 - SIDE:
            continue
        excess = (n - first) / (last - first) - share[n]
        if excess < quietest:
            quietest, start = excess, n
        if excess - quietest > gain:
            gain, best = excess - quietest, (start, n)
    return best
