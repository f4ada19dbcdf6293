"""Forests of scikit-learn to hold the flattened ones against."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import IsolationForest, RandomForestRegressor

Floats = NDArray[np.float64]
SPREAD = np.array([10.0, 1000.0, 300.0, 5.0, 0.1])
CENTRE = np.array([40.0, 6000.0, 1000.0, 40.0, 0.2])


def machine_rows(count: int, seed: int) -> Floats:
    """Load, speed, feed, temperature, vibration: unlike in size."""
    return np.random.default_rng(seed).normal(size=(count, 5)) * SPREAD + CENTRE


def isolation(trees: int = 50, rows: int = 2000, **parameters: Any) -> Any:
    return IsolationForest(n_estimators=trees, **{"contamination": 0.01, "random_state": 1, **parameters}).fit(
        machine_rows(rows, 1)
    )


def regression(kind: Any = RandomForestRegressor, **parameters: Any) -> Any:
    rows = np.random.default_rng(2).normal(size=(1500, 8))
    target = 2.0 * rows[:, 0] + np.sin(3.0 * rows[:, 1]) + rows[:, 2] * rows[:, 3]
    given = {"n_estimators": 30, "max_depth": 14, "min_samples_leaf": 5, "random_state": 1, "n_jobs": 1, **parameters}
    return kind(**given).fit(rows, target)


def same_bits(left: Any, right: Any) -> bool:
    """Not merely close, nor equal as −0 and 0 are."""
    ours, theirs = np.asarray(left, dtype=np.float64), np.asarray(right, dtype=np.float64)
    return ours.shape == theirs.shape and bool((ours.view(np.int64) == theirs.view(np.int64)).all())
