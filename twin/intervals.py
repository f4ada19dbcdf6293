"""Intervals for anything that is made of parts that are independent of each other."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

Part = TypeVar("Part")


@dataclass(frozen=True, slots=True)
class Estimate:
    """value: NaN where there was nothing to count"""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.2f} ({self.low:.2f} to {self.high:.2f})"


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
