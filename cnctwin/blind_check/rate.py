"""A share of so many cases, with its exact 95 % interval.

Clopper and Pearson 1934, Biometrika 26(4): the interval of a binomial share whose ends are quantiles of beta distributions.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from scipy.stats import beta


@dataclass(frozen=True, slots=True)
class Rate:
    """hits of count."""

    hits: int
    count: int

    @property
    def share(self) -> float:
        """hits / count; NaN of none."""
        return self.hits / self.count if self.count else float("nan")

    @property
    def low(self) -> float:
        """Lower end of the interval. Of 10 of 10: 0.025^(1/10).

        >>> round(Rate(10, 10).low, 4)
        0.6915
        """
        return float(beta.ppf(0.025, self.hits, self.count - self.hits + 1)) if self.hits else 0.0

    @property
    def high(self) -> float:
        """Upper end of the interval."""
        return float(beta.ppf(0.975, self.hits + 1, self.count - self.hits)) if self.hits < self.count else 1.0

    def __str__(self) -> str:
        if not self.count:
            return "–"
        return f"{100 * self.share:.0f} % ({100 * self.low:.0f}–{100 * self.high:.0f}; {self.hits}/{self.count})"


def rate_of(outcomes: Iterable[bool]) -> Rate:
    """The share of those that are true."""
    listed = list(outcomes)
    return Rate(sum(listed), len(listed))
