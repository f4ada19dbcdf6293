"""The uses left of a tool: when the share of its life passes the share at which such tools are replaced.

    P(m) = Σ_i p_i Φ((u_i + m r_i − 1) / √(v + m n² b² / 3 + s²)),   given that it has not passed yet: (P(m) − P(0)) / (1 − P(0))

over rates r_i, which are taken to be log-normal with the trend's mean and variance (Gauss-Hermite, seven points), u_i and v
being mean and variance of the share given the rate. n is m, at most a life, since a rate does not wander away for ever. s is
the spread of the share at which earlier lives ended.
"""

from math import erf, exp, log, sqrt
from typing import NamedTuple

from twin.wear.trend import Trend

USES_MAX = 20_000.0
STEP = 1.1
BAND = (0.05, 0.5, 0.95)
POINTS = (0.0, 1.1544053947399682, 2.3667594107345415, 3.750439717725742)
WEIGHTS = (0.45714285714285713, 0.2401231786050126, 0.030757123967586494, 0.0005482688559722178)
HERMITE = tuple((sign * z, p) for z, p in zip(POINTS, WEIGHTS, strict=True) for sign in ((1.0, -1.0) if z else (1.0,)))


class Left(NamedTuple):
    """The uses left: low and high are the ends of the band of 90 %."""

    low: float
    middle: float
    high: float


class _Spent(NamedTuple):
    """The chance that a tool is spent, as it depends on the uses: (share, rate, weight) of each point, and what the share
    varies by.
    """

    points: tuple[tuple[float, float, float], ...]
    var: float
    wander: float
    life: float

    def after(self, uses: float) -> float:
        """Return the chance that the tool is spent after so many more uses."""
        wandered = self.wander * uses * min(uses, self.life) ** 2 / 3.0
        scale = sqrt(2.0 * (self.var + wandered))
        return sum(0.5 * p * (1.0 + erf((share + uses * rate - 1.0) / scale)) for share, rate, p in self.points)


def left(trend: Trend, end_var: float, rate_wander: float) -> Left | None:
    """Return the uses left; None where the rate is not above nothing, or the band is not finite.

    >>> left(Trend(0.5, 0.01, 1e-8, 0.0, 1e-12), 1e-8, 0.0)
    Left(low=50.0, middle=50.0, high=50.0)
    """
    if trend.rate <= 0.0:
        return None
    spread = sqrt(log(1.0 + trend.rate_var / trend.rate**2))
    points = []
    for z, p in HERMITE:
        rate = trend.rate * exp(spread * z - 0.5 * spread * spread)
        points.append((trend.share + trend.cov / trend.rate_var * (rate - trend.rate), rate, p))
    var = max(trend.var - trend.cov**2 / trend.rate_var, 1e-12) + end_var
    spent = _Spent(tuple(points), var, rate_wander, 1.0 / trend.rate)
    before = spent.after(0.0)
    if before > 0.999:
        return Left(0.0, 0.0, 0.0)
    found, wanted = [], [before + (1.0 - before) * share for share in BAND]
    here, there = 0.0, 0.5
    while wanted and there <= USES_MAX:
        chance = spent.after(there)
        while wanted and chance >= wanted[0]:
            found.append(round(_between(spent, here, there, wanted.pop(0)), 1))
        here, there = there, there * STEP
    return None if wanted else Left(found[0], found[1], found[2])


def _between(spent: _Spent, low: float, high: float, wanted: float) -> float:
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if spent.after(middle) >= wanted else (middle, high)
    return high
