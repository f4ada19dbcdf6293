"""Residuals on several time scales, and the tails of healthy parts that make them comparable.

    s ← s + (1 − exp(−tick / τ)) · r² · (z / r − s)          τ: 3 s, 30 s, 5 min, 2 min of one tool

r tells how much a tick says: 1 where the section repeats as well as sections usually do, less at an edge, 0 where nothing is
told. So s is a mean in which each tick counts by its precision, in usual spreads of the signal.

The last scale is kept for each tool while others cut, so a tool that is dull or mounted too long is compared with its own last
parts. A tail is the size that healthy parts exceed about once in two weeks on that scale and side, so that all of them alarm
equally often.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

SCALES = ("seconds", "cut", "part", "tool")
TAUS_S = (3.0, 30.0, 300.0, 120.0)
TOOL = 3
COUNT = len(SCALES)
CLIP = 12.0
FORGETS = 0.5
"""A tool comes back with half of its residual: a fault that all tools had is forgotten soon after it is gone."""
BLOCK_S = 900.0
DAY_S, RETURN_S = 86_400.0, 14 * 86_400.0
TAIL_LEAST = (2.0, 1.5, 1.5, 1.5)
"""Least tails on each scale, in spreads of a tick: what healthy parts never did in training may still be no fault."""


def shares(tick_s: float) -> tuple[float, ...]:
    """Return the share of a new tick on each scale.

    >>> [round(share, 3) for share in shares(1.0)]
    [0.283, 0.033, 0.003, 0.008]
    """
    return tuple(1.0 - math.exp(-tick_s / tau_s) for tau_s in TAUS_S)


def smoothed(before: Sequence[float], z: Sequence[float], tells: Sequence[float], each: Sequence[float]) -> tuple[float, ...]:
    """Return the residuals by signal, each on all scales, after one more tick; z: r · z, tells: r², 0 = nothing.

    >>> smoothed((0.0,) * 4, (4.0,), (1.0,), (0.5, 0.25, 0.125, 0.25))
    (2.0, 1.0, 0.5, 1.0)
    """
    a, b, c, d = each
    found: list[float] = []
    at = 0
    for value, told in zip(z, tells, strict=True):
        s, t, u, v = before[at : at + 4]
        at += 4
        if told:
            found += (
                s + a * (value - told * s),
                t + b * (value - told * t),
                u + c * (value - told * u),
                v + d * (value - told * v),
            )
        else:
            found += (s, t, u, v)
    return tuple(found)


def of_tool(smooth: Sequence[float]) -> tuple[float, ...]:
    """Return the residuals of the tool in the spindle, by signal."""
    return tuple(smooth[TOOL::COUNT])


def with_tool(smooth: Sequence[float], slow: Sequence[float]) -> tuple[float, ...]:
    """Return the residuals once another tool is in the spindle, whose own were `slow` when it left."""
    found = list(smooth)
    found[TOOL::COUNT] = [FORGETS * value for value in slow]
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
