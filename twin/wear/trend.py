"""The wear of one tool as a local linear trend of the share u of its life, which the level shows through the curve of earlier
lives.

    u' = u + r n + ν,   r' = r + η,   level = R g(u) + ε,        ν ~ N(0, n a²), η ~ N(0, n b²)

over n uses, followed by an extended Kalman filter (Harvey, Forecasting, Structural Time Series Models and the Kalman Filter,
1989, section 2.3.2). R is the level at the end of a life, r the share of a life that a use costs. A level further than HUBER
deviations off pulls no more than one at HUBER (Masreliez and Martin, IEEE Trans. Automatic Control 22, 1977).
"""

from math import log, sqrt
from typing import NamedTuple

from twin.wear.curve import Curve, at, slope

HUBER = 2.5
SLOPE_MIN = 0.1


class Trend(NamedTuple):
    """Share of the life and its rate a use, with their covariance; fit: log likelihood of what was seen since it began."""

    share: float
    rate: float
    var: float
    cov: float
    rate_var: float
    fit: float = 0.0


class Wander(NamedTuple):
    """Variances by which share and rate wander in a use: a² and b²."""

    share: float
    rate: float


def advanced(trend: Trend, uses: float, wander: Wander) -> Trend:
    """Return the trend after so many uses that told nothing."""
    var = trend.var + 2.0 * uses * trend.cov + uses * uses * trend.rate_var + uses * wander.share
    cov = trend.cov + uses * trend.rate_var
    return Trend(trend.share + uses * trend.rate, trend.rate, var, cov, trend.rate_var + uses * wander.rate, trend.fit)


def updated(trend: Trend, level: float, noise: float, limit: float, curve: Curve) -> Trend:
    """Return the trend after a level of variance `noise`.

    >>> from twin.wear.curve import LINE
    >>> seen = updated(Trend(0.5, 0.01, 0.01, 0.0, 1e-6), 0.12, 0.0004, 0.2, LINE)
    >>> round(seen.share, 3)
    0.55
    """
    gain_of = limit * max(slope(curve, trend.share), SLOPE_MIN)
    off = level - limit * at(curve, trend.share)
    spread = gain_of * gain_of * trend.var + noise
    far = abs(off) / sqrt(spread)
    loss = 0.5 * far * far
    if far > HUBER:
        loss = HUBER * far - 0.5 * HUBER * HUBER
        off *= HUBER / far
    gain, rate_gain = gain_of * trend.var / spread, gain_of * trend.cov / spread
    return Trend(
        trend.share + gain * off,
        trend.rate + rate_gain * off,
        max(trend.var * (1.0 - gain * gain_of), 1e-12),
        trend.cov * (1.0 - gain * gain_of),
        max(trend.rate_var - rate_gain * gain_of * trend.cov, 1e-18),
        trend.fit - loss - 0.5 * log(spread),
    )
