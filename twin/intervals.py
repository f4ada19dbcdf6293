"""Intervals for shares, rates and anything that is made of parts that are independent of each other."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.special import gammaincinv, ndtri

Part = TypeVar("Part")


@dataclass(frozen=True, slots=True)
class Estimate:
    """value: NaN where there was nothing to count"""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.2f} ({self.low:.2f} to {self.high:.2f})"


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


def bootstrapped(
    parts: Sequence[Part],
    figure: Callable[[Sequence[Part]], float],
    rng: np.random.Generator,
    coverage: float = 0.9,
    draws: int = 1000,
) -> Estimate:
    """A figure of parts that are independent (machines, weeks), resampled with replacement; NaN of a draw is left out."""
    if not parts:
        return Estimate(math.nan, math.nan, math.nan)
    drawn = [figure([parts[place] for place in rng.integers(len(parts), size=len(parts))]) for _ in range(draws)]
    finite = [value for value in drawn if math.isfinite(value)]
    if not finite:
        return Estimate(figure(parts), math.nan, math.nan)
    low, high = np.quantile(finite, [0.5 - coverage / 2.0, 0.5 + coverage / 2.0])
    return Estimate(figure(parts), float(low), float(high))
