"""Trained forests as flat arrays, scored by our own kernel: the same bits as scikit-learn, a thousandth of its time for one row.

    model = IsolationForest(n_estimators=200, contamination=0.01).fit(rows)
    scorer = flatten_isolation(model)
    scorer.score_one((61.0, 6000.0, 1200.0, 41.5, 0.12))     # == -model.decision_function([[61.0, …]])[0]

What is compared with scikit-learn: rows of float64, a forest on one thread (`n_jobs=1`; with more, a random forest of
scikit-learn adds its trees in the order in which threads finish).
"""

from twin.forest.errors import ForestError
from twin.forest.flattening import flatten_isolation, flatten_regression
from twin.forest.forest import Forest
from twin.forest.isolation import IsolationScorer
from twin.forest.regression import RegressionForest

__all__ = ["Forest", "ForestError", "IsolationScorer", "RegressionForest", "flatten_isolation", "flatten_regression"]
