"""Intervals for shares and rates; `twin.intervals` has those of anything else."""

import math

from scipy.special import gammaincinv, ndtri

from twin.intervals import Estimate


def share(hits: int, count: int, coverage: float = 0.9) -> Estimate:
    """hits of count, with the interval of Wilson (1927), which holds for few and for all or none.

    >>> print(share(9, 10, 0.95))
    0.90 (0.60 to 0.98)
    """
    if count == 0:
        return Estimate(math.nan, 0.0, 1.0)
    z = float(ndtri(0.5 + coverage / 2.0))
    p, spread = hits / count, z * z / count
    middle = (p + spread / 2.0) / (1.0 + spread)
    half = z / (1.0 + spread) * math.sqrt(p * (1.0 - p) / count + spread / (4.0 * count))
    return Estimate(p, max(0.0, middle - half), min(1.0, middle + half))


def rate(count: int, exposure: float, coverage: float = 0.9) -> Estimate:
    """Events by unit of exposure, with the exact Poisson interval of Garwood (1936).

    >>> print(rate(3, 4.0))
    0.75 (0.20 to 1.94)
    """
    if not exposure > 0.0:
        return Estimate(math.nan, 0.0, math.inf)
    low = float(gammaincinv(count, 0.5 - coverage / 2.0)) if count else 0.0
    high = float(gammaincinv(count + 1, 0.5 + coverage / 2.0))
    return Estimate(count / exposure, low / exposure, high / exposure)
