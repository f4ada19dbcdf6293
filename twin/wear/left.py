"""The uses left of a tool: when the share of its life passes the share at which such tools are replaced.

    P(m) = Φ((u + m r − 1) / √(Var(u + m r) + m b² m² / 3 + s²)),   given that it has not passed yet: (P(m) − P(0)) / (1 − P(0))

s is the spread of the share at which earlier lives ended. The band is Fieller's (J. R. Statist. Soc. B 16, 1954): where the slope is not
clearly above nothing, its upper end is at infinity, and nothing is given.
"""

from math import erf, sqrt
from typing import NamedTuple

from twin.wear.trend import Trend

USES_MAX = 20_000.0
STEP = 1.06
BAND = (0.05, 0.5, 0.95)


class Left(NamedTuple):
    """The uses left: low and high are the ends of the band of 90 %."""

    low: float
    middle: float
    high: float


def left(trend: Trend, end_var: float, rate_wander: float) -> Left | None:
    """Return the uses left; None where its band is not finite.

    >>> left(Trend(0.5, 0.01, 1e-8, 0.0, 1e-12), 1e-8, 0.0)
    Left(low=50.0, middle=50.0, high=50.0)
    """
    before = _passed(trend, 0.0, end_var, rate_wander)
    if before > 0.999:
        return Left(0.0, 0.0, 0.0)
    found, wanted = [], [before + (1.0 - before) * share for share in BAND]
    here, there = 0.0, 0.5
    while wanted and there <= USES_MAX:
        while wanted and _passed(trend, there, end_var, rate_wander) >= wanted[0]:
            found.append(round(_between(trend, here, there, wanted.pop(0), end_var, rate_wander), 1))
        here, there = there, there * STEP
    return None if wanted else Left(found[0], found[1], found[2])


def _passed(trend: Trend, uses: float, end_var: float, rate_wander: float) -> float:
    """Return the chance that the tool is spent after so many more uses."""
    wandered = rate_wander * uses**3 / 3.0
    var = trend.var + 2.0 * uses * trend.cov + uses * uses * trend.rate_var + wandered + end_var
    return 0.5 * (1.0 + erf((trend.share + uses * trend.rate - 1.0) / sqrt(2.0 * max(var, 1e-15))))


def _between(trend: Trend, low: float, high: float, wanted: float, end_var: float, rate_wander: float) -> float:
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _passed(trend, middle, end_var, rate_wander) >= wanted else (middle, high)
    return high
