"""Random forest for regression: the mean of what its trees say (L. Breiman, "Random Forests", 2001)."""

from collections.abc import Sequence
from dataclasses import dataclass

from twin.forest.forest import Forest
from twin.forest.kernels import Floats


@dataclass(frozen=True, slots=True, eq=False)
class RegressionForest:
    """Predicts one figure; scikit-learn's predict with n_jobs=1, to the last bit."""

    forest: Forest

    def predict_one(self, values: Sequence[float]) -> float:
        """The prediction for one row. Raises ForestError where it has not one finite number for each feature."""
        return self.forest.total_one(values) / self.forest.trees

    def predict(self, rows: Floats) -> Floats:
        """The predictions (n,) for rows (n, features)."""
        return self.forest.totals(rows) / self.forest.trees
