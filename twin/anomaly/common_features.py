"""The remainder of a machine's features beside those of its peers, feature by feature.

    left_f = sign(s_f) · max(0, |s_f| − 2 · c_f)     c_f: the ⌈n/5⌉-th largest of the peers' s_f in the direction of s_f, or 0
    adjusted = sqrt(Σ (left_f / tail_f)²)

on smoothed features (`preparation.py`); a MEWMA chart (Lowry et al. 1992) of what the cell does not share. A score has lost
which feature it comes from: a peer that vibrates then hides a spindle that is hot. Peers feel a disturbance more weakly or more
strongly, hence the 2; a fifth of them may be broken or far away. A peer's feature counts for two minutes after it was last told
of, so that a peer in a tool change still has a word, by what it was before: its transient never enters.

tail_f is how far what is left goes in the training data, each side by itself: a rapid raises a feed far, a fault lowers it a
little.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from twin.anomaly.preparation import Preparation, Smoothed

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

GAIN = 2.0
ONE_IN = 5
MEMORY_S = 120.0
TAIL_QUANTILE = 0.998
TAIL_LEAST = 0.3


def left_over(own: Smoothed, peers: Sequence[Smoothed], tick: int, tick_s: float) -> tuple[float, ...]:
    """Return the part of each feature that the peers do not explain, as of a tick that all have come to.

    >>> own, peer = Smoothed((5.0, -4.0), (9, 9)), Smoothed((1.0, 3.0), (9, 9))
    >>> left_over(own, [peer], 9, 1.0)
    (3.0, -4.0)
    """
    oldest = tick - round(MEMORY_S / tick_s)
    return tuple([_left(s, [peer.values[f] for peer in peers if peer.ticks[f] >= oldest]) for f, s in enumerate(own.values)])


def _left(own: float, peers: list[float]) -> float:
    if not peers or own == 0.0:
        return own
    place = math.ceil(len(peers) / ONE_IN) - 1
    if own > 0.0:
        shared = max(peers) if place == 0 else sorted(peers, reverse=True)[place]
        return max(0.0, own - GAIN * max(0.0, shared))
    shared = min(peers) if place == 0 else sorted(peers)[place]
    return min(0.0, own - GAIN * min(0.0, shared))


def length(preparation: Preparation, left: Sequence[float]) -> float:
    """Return the length of that remainder, in tails of the training data."""
    total = 0.0
    for value, up, down in zip(left, preparation.up, preparation.down, strict=True):
        share = value / up if value > 0.0 else value / down
        total += share * share
    return math.sqrt(total)


def left_over_rows(
    smooth: "NDArray[np.float64]", last: "NDArray[np.integer]", ticks: "NDArray[np.integer]", tick_s: float
) -> "NDArray[np.float64]":
    """The same of a cell, (T, N, F); last: when each feature was last told of, (T, N, F); ticks: when it is now, (T,)."""
    import numpy as np  # noqa: PLC0415  the stream needs none

    left = np.empty(smooth.shape)
    fresh = last >= (ticks - round(MEMORY_S / tick_s))[:, None, None]
    rows, machines, features = smooth.shape
    for place in range(machines):
        counted = np.delete(fresh, place, axis=1)
        peers = np.delete(smooth, place, axis=1)
        own, known = smooth[:, place], counted.sum(axis=1)
        which = np.maximum(-(-known // ONE_IN) - 1, 0)[:, None, :]
        shared = {}
        for sign in (1.0, -1.0):
            ordered = -np.sort(-np.where(counted, sign * peers, -np.inf), axis=1)
            picked = np.take_along_axis(ordered, which, axis=1)[:, 0] if machines > 1 else np.zeros((rows, features))
            shared[sign] = np.maximum(picked, 0.0)
        above = np.maximum(0.0, own - GAIN * shared[1.0])
        left[:, place] = np.where(own > 0.0, above, -np.maximum(0.0, -own - GAIN * shared[-1.0]))
    return left


def with_tails(preparation: Preparation, left: "NDArray[np.float64]") -> Preparation:
    """The preparation with the tails of what was left in the training data, rows (T, F) that are judged.

    Raises ValueError where there are none.
    """
    import numpy as np  # noqa: PLC0415

    if not len(left):
        raise ValueError("no row is judged, outside tool changes, in an operation with two minutes or more of it: record more")
    up, down = (np.quantile(np.maximum(side, 0.0), TAIL_QUANTILE, axis=0) + TAIL_LEAST for side in (left, -left))
    return preparation.model_copy(update={"up": tuple(up.tolist()), "down": tuple(down.tolist())})
