"""Residuals on several time scales, and the tails of healthy parts that make them comparable.

    seconds, cut:    s ← s + (1 − exp(−tick / τ)) · r² · (z / r − s)          τ: 3 s, 30 s
    operation:       the change of the cut since the operation began (`operation.py`), in standard deviations
    part:            that of the last four operations together; of a signal that knows no levels, s with τ = 5 min
    tool:            the lesser of that of this operation and of the last one with the same tool

r tells how much a tick says: 1 where the section repeats as well as sections usually do, less at an edge, 0 where nothing is
told. So s is a mean in which each tick counts by its precision, in usual spreads of the signal. A tail is the size that healthy
parts exceed about once in two weeks on that scale and side, so that all of them alarm equally often.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

SCALES = ("seconds", "cut", "operation", "part", "tool")
CUT, OPERATION = 1, 2
TAUS_S = (3.0, 30.0, 300.0)
COUNT = len(SCALES)
CLIP = 12.0
BLOCK_S = 900.0
DAY_S, RETURN_S = 86_400.0, 14 * 86_400.0
TAIL_LEAST = (2.0, 1.5, 4.0, 3.0, 2.5)
"""Least tails on each scale, in spreads: what healthy parts never did in training may still be no fault."""


def shares(tick_s: float) -> tuple[float, ...]:
    """Return the share of a new tick in the means of 3 s, 30 s and 5 min.

    >>> [round(share, 3) for share in shares(1.0)]
    [0.283, 0.033, 0.003]
    """
    return tuple(1.0 - math.exp(-tick_s / tau_s) for tau_s in TAUS_S)


def smoothed(
    before: Sequence[float], z: Sequence[float], tells: Sequence[float], each: Sequence[float], cuts: Sequence[Sequence[float]]
) -> tuple[float, ...]:
    """Return the residuals by signal, each on all scales, after one more tick; z: r · z, tells: r², 0 = nothing.

    cuts: of each signal its figures on the last three scales, () where it follows no levels

    >>> smoothed((0.0,) * 5, (4.0,), (1.0,), (0.5, 0.25, 0.125), ((),))
    (2.0, 1.0, 0.0, 0.5, 0.0)
    """
    a, b, c = each
    found: list[float] = []
    at = 0
    for value, told, cut in zip(z, tells, cuts, strict=True):
        s, t, _, u, _ = before[at : at + 5]
        at += 5
        if told:
            s += a * (value - told * s)
            t += b * (value - told * t)
        if cut:
            found += (s, t, *cut)
        else:
            found += (s, t, 0.0, u + c * (value - told * u) if told else u, 0.0)
    return tuple(found)


def tails(left: "NDArray[np.float64]", blocks: "NDArray[np.integer]", block_s: float = BLOCK_S) -> "NDArray[np.float64]":
    """Return the size that each column of healthy remainders (T, K) exceeds once in RETURN_S.

    The largest of each block beyond the size q that is reached once a day lie above it by β on average; on an exponential tail
    (Davison and Smith 1990) the size is q + β ln(RETURN_S / day). Never less than `TAIL_LEAST`. blocks: (T,), ascending.
    """
    import numpy as np  # noqa: PLC0415  the stream needs none

    begins = np.flatnonzero(np.diff(blocks, prepend=-1))
    largest = np.maximum.reduceat(np.maximum(left, 0.0), begins, axis=0)
    daily = np.quantile(largest, max(0.5, 1.0 - block_s / DAY_S), axis=0)
    beyond = np.where(largest > daily, largest - daily, 0.0)
    mean = beyond.sum(axis=0) / np.maximum((largest > daily).sum(axis=0), 1)
    least = np.resize(TAIL_LEAST, left.shape[1])
    return np.asarray(np.maximum(daily + mean * math.log(RETURN_S / DAY_S), least), dtype=np.float64)
