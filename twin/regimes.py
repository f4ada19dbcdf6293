"""Regimes of an axis, from its reference alone: what it is told to do, so that a twin's error does not shift a sample's regime.

* rest: the reference has stood still for 60 ms
* reversal: from 5 ms before to 40 ms after the velocity of the reference changes its sign, and the first 40 ms from rest
* acceleration: the reference accelerates
* constant -, constant +: it does not
"""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

SETTLING_S = 0.06
BEFORE_REVERSAL_S = 0.005
AFTER_REVERSAL_S = 0.04
ACCELERATION_MM_S2_MIN = 5.0


class Regime(IntEnum):
    """The regime of an axis: what its reference makes it do."""

    REST = 0
    REVERSAL = 1
    ACCELERATION = 2
    CONSTANT_MINUS = 3
    CONSTANT_PLUS = 4

    @property
    def title(self) -> str:
        """As it is written in reports."""
        return ("rest", "reversal", "acceleration", "constant speed -", "constant speed +")[self]


def axis_regimes(t_s: NDArray[np.float64], reference_mm: NDArray[np.float64]) -> NDArray[np.int8]:
    """The regime of each sample, (n,). The samples are taken to be evenly spaced.

    A metre a second is reached within 100 ms, held for 300 ms; before and after that the axis rests:

    >>> t_s = np.arange(1000) * 0.001
    >>> speed = np.interp(t_s, [0, 0.3, 0.4, 0.7, 0.8, 1.0], [0, 0, 1000, 1000, 0, 0])
    >>> regimes = axis_regimes(t_s, np.cumsum(speed) * 0.001)
    >>> [Regime(regimes[i]).title for i in (100, 310, 360, 600, 750, 950)]
    ['rest', 'reversal', 'acceleration', 'constant speed +', 'acceleration', 'rest']
    """
    n = len(t_s)
    if n < 3:
        return np.zeros(n, dtype=np.int8)
    period_s = float(np.median(np.diff(t_s)))
    velocity = np.gradient(reference_mm, period_s)
    window = min(max(1, round(0.005 / period_s)), n)
    smooth = np.convolve(velocity, np.ones(window) / window, mode="same")
    acceleration = np.gradient(smooth, period_s)
    regimes = np.where(velocity > 0, Regime.CONSTANT_PLUS, Regime.CONSTANT_MINUS).astype(np.int8)
    regimes[np.abs(acceleration) > ACCELERATION_MM_S2_MIN] = Regime.ACCELERATION

    sign = np.sign(np.where(np.abs(velocity) > 1e-6, velocity, 0.0))
    index = np.arange(n)
    moved = np.maximum.accumulate(np.where(sign != 0, index, -n))
    since_motion_s = (index - moved) * period_s
    rest = since_motion_s > SETTLING_S
    last_sign = np.where(moved >= 0, sign[np.maximum(moved, 0)], 0.0)
    before = np.concatenate([[0.0], last_sign[:-1]])
    turns = np.flatnonzero((sign != 0) & ((sign != before) | np.concatenate([[False], rest[:-1]])))
    regimes[(sign == 0) & ~rest] = Regime.ACCELERATION  # it settles
    for turn in turns:
        start = max(0, turn - round(BEFORE_REVERSAL_S / period_s))
        regimes[start : turn + round(AFTER_REVERSAL_S / period_s)] = Regime.REVERSAL
    regimes[rest & (regimes != Regime.REVERSAL)] = Regime.REST
    return regimes


REST_BEFORE_S = 0.1
REST_AFTER_S = 0.2
MOVING_MIN = 50
"""Samples of motion below which there is nothing to look at."""


def motion_stretches(t_s: NDArray[np.float64], reference_mm: NDArray[np.float64]) -> tuple[slice, ...]:
    """The stretches of motion, each with a little of the rest before and after it; the whole where the axis never rests."""
    still = np.concatenate([[True], np.diff(reference_mm) == 0])
    moving = np.flatnonzero(~still)
    if len(moving) < MOVING_MIN:
        return ()
    period_s = float(np.median(np.diff(t_s)))
    before, after = round(REST_BEFORE_S / period_s), round(REST_AFTER_S / period_s)
    breaks = np.flatnonzero(np.diff(moving) > before + after)
    firsts, lasts = moving[np.concatenate([[0], breaks + 1])], moving[np.concatenate([breaks, [len(moving) - 1]])]
    ends = np.minimum(lasts + after, len(t_s))
    return tuple(slice(max(0, int(first) - before), int(end)) for first, end in zip(firsts, ends, strict=True))
