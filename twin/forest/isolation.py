"""Isolation forest: how few splits it takes to part a row from all others.

    s(x) = 2^(−E[h(x)] / c(ψ)),  h = depth of the row's leaf + c(rows in that leaf),
    c(n) = 2 (ln(n − 1) + γ) − 2 (n − 1) / n,  c(2) = 1,  c(1) = 0

with ψ training rows in each tree (F. T. Liu, K. M. Ting, Z.-H. Zhou, "Isolation Forest", ICDM 2008). The score here is s(x) less
the level that the given share of the training rows exceeds: 0 = as odd as that share, higher = worse. It is scikit-learn's
−decision_function and PyOD's decision_function, to the last bit.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.forest.forest import Forest
from twin.forest.kernels import Floats


@dataclass(frozen=True, slots=True, eq=False)
class IsolationScorer:
    """denominator: trees · c(ψ); offset: scikit-learn's offset_, −s at which the score is 0."""

    forest: Forest
    denominator: float
    offset: float

    def score_one(self, values: Sequence[float]) -> float:
        """The score of one row. Raises ForestError where it has not one finite number for each feature."""
        depth = self.forest.total_one(values)
        exponent = -(depth / self.denominator) if self.denominator else -1.0
        return float(-(-np.power(2.0, exponent) - self.offset))

    def scores(self, rows: Floats) -> Floats:
        """The scores (n,) of rows (n, features)."""
        return -(self.score_samples(rows) - self.offset)

    def score_samples(self, rows: Floats) -> Floats:
        """−s(x), (n,), as scikit-learn calls it."""
        depths = self.forest.totals(rows)
        return -np.power(2.0, -(depths / self.denominator) if self.denominator else np.full(len(depths), -1.0))
