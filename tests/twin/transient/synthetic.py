"""A small detector that was learned from the synthetic drive of `benchmarks/tool_change_detector.py`."""

from functools import cache

import numpy as np

from benchmarks.synthetic_changes import learned_from
from twin.transient.training import Trained


@cache
def small() -> Trained:
    """Learned from five captures at 10 dB and four hours of null."""
    return learned_from(5, 4.0, 10.0, np.random.default_rng(7))
