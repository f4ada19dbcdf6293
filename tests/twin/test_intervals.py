"""The bootstrap of a figure that is made of parts."""

import math

import numpy as np
import pytest

from twin.intervals import bootstrapped


def test_no_parts_are_no_figure() -> None:
    assert math.isnan(bootstrapped([], lambda _: 1.0, np.random.default_rng(1)).value)


def test_the_bootstrap_resamples_parts() -> None:
    estimate = bootstrapped(list(range(100)), lambda parts: float(np.mean(parts)), np.random.default_rng(3))
    assert estimate.value == 49.5
    assert (estimate.low, estimate.high) == pytest.approx((44.7, 54.2), abs=1.0)
