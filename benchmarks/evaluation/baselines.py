"""Scores that know nothing or next to nothing: what a detector has to beat before it is one."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def random_score(count: int, rng: np.random.Generator) -> Floats:
    """Chance, (T,)."""
    return rng.random(count)


def constant_score(count: int) -> Floats:
    """Always the same, (T,): whoever alarms always finds all events, and whoever never does has no false alerts."""
    return np.ones(count)


def one_feature_score(values: Floats, training: Floats) -> Floats:
    """Return how far one signal (T,) is above its median in training, in robust standard deviations: a limit on a gauge."""
    low, middle, high = np.percentile(training, [25.0, 50.0, 75.0])
    return np.asarray((values - middle) / max((high - low) / 1.349, 1e-9), dtype=np.float64)
