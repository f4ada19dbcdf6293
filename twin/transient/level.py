"""The level that is matched, from the signal that is reported, in whole quanta.

A speed works over decades: the spindle stops from 12000 rev/min or from 750, and turns at 250 to orient itself; so its level is
asinh(n / 100 rev/min), which is linear near standstill and logarithmic above. Current and load are their own level. A level is
rounded to a whole number of quanta: sums of whole numbers below 2^53 are exact in any order, so running sums neither drift nor
differ after a restart.
"""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SPEED = "spindle_rpm"
SIGNALS = (SPEED, "spindle_current_a", "spindle_load_pct")
SPEED_KNEE_RPM = 100.0
QUANTA = 2**12
"""Quanta in one standard deviation of the captured transients."""
QUANTA_MAX = 2**19


def level(signal: str, value: float) -> float:
    """The level of one value.

    >>> round(level("spindle_rpm", 1000.0), 3), level("spindle_current_a", 12.5)
    (2.998, 12.5)
    """
    return math.asinh(abs(value) / SPEED_KNEE_RPM) if signal == SPEED else value


def levels(signal: str, values: Floats) -> Floats:
    """The levels of an array, one by one as `level` has them."""
    return np.array([level(signal, float(value)) for value in values])
