"""A learned term while it is being fitted: its values at the knots are free numbers of the hypothesis.

    value = size · L z,   z ~ N(0, SIGMA²),   L Lᵀ = exp(−½ (Δ / length)²) over the knots of each argument

so that the prior of each z is alike and the term is smooth (a Gaussian process on the knots: Rasmussen and Williams 2006,
section 2.2). A constant and a straight line are in it as well (section 2.7 there), so that it goes on where nothing was recorded.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, reduce

import numpy as np
from numpy.typing import NDArray

from twin.gap.stages.free import Form, Free
from twin.learned.knots import Knots
from twin.learned.term import Term
from twin.learned.words import PERIODS, LearnedSite

Floats = NDArray[np.float64]
SIGMA, FAR = 3.0, 30.0
"""Standard deviation of z, and its bounds."""
JITTER = 1e-6
Z90 = 1.6448536269514722


@dataclass(frozen=True, eq=False)
class FreeTerm:
    """size: of its values, in the unit of the site; lengths: column → distance over which neighbours are alike, 0 = none."""

    site: LearnedSite
    on: str
    knots: Knots
    size: float
    lengths: Mapping[str, float]

    @property
    def name(self) -> str:
        """Its name among the free numbers."""
        return "__".join(("learned", self.site.value, self.on, *self.knots.columns))

    @cached_property
    def free(self) -> tuple[Free, ...]:
        """The free numbers z, one a knot."""
        return tuple(Free(f"{self.name}__{i}", Form.LINEAR, 1.0, 0.0, SIGMA, -FAR, FAR, "") for i in range(self.knots.count))

    @cached_property
    def root(self) -> Floats:
        """size · L, (count, count)."""
        parts = []
        for column, knots in self.knots.by_column.items():
            apart = np.abs(knots[:, None] - knots[None, :])
            if column in PERIODS:
                apart = PERIODS[column] / np.pi * np.sin(np.pi * apart / PERIODS[column])  # the chord
            length = self.lengths.get(column, 0.0)
            alike = np.exp(-0.5 * (apart / length) ** 2) + _trend(column, knots) if length > 0.0 else np.eye(len(knots))
            parts.append(np.linalg.cholesky(alike + JITTER * np.eye(len(knots))))
        return np.asarray(self.size * reduce(np.kron, parts))

    def series(self, z: Floats, arguments: Mapping[str, Floats]) -> Floats:
        """Return its series in each lane, (lanes, n), at z, (lanes, count)."""
        return self.knots.interpolated(z @ self.root.T, arguments)

    def term(self, z: Floats, covariance: Floats) -> Term:
        """Return the term at z, (count,), with the 90 % band of its covariance, (count, count)."""
        value = self.root @ z
        half = Z90 * np.sqrt(np.maximum(np.diag(self.root @ covariance @ self.root.T), 0.0))
        return Term(self.site, self.on, self.knots, value, value - half, value + half)


def _trend(column: str, knots: Floats) -> Floats:
    """Covariance of a constant and a straight line over the knots of an argument that does not come round again."""
    if column in PERIODS or len(knots) < 2:
        return np.zeros((len(knots), len(knots)))
    along = 2.0 * (knots - knots[0]) / (knots[-1] - knots[0]) - 1.0
    return np.asarray(1.0 + np.outer(along, along))
