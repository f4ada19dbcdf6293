"""Least squares over a simulator that runs candidates side by side."""

import numpy as np
import pytest
from numpy.typing import NDArray

from twin.gap.descent import Bounds, descend

Floats = NDArray[np.float64]
T = np.linspace(0.0, 4.0, 200)
BLOCKS = np.arange(200) // 10


def bounds(*limits: tuple[float, float, float]) -> Bounds:
    """(sigma, low, high) of each."""
    return Bounds(*(np.array(column) for column in zip(*limits, strict=True)))


def decay(theta: Floats) -> Floats:
    """a exp(−k t), (lanes, n)."""
    return np.asarray(theta[:, :1] * np.exp(-theta[:, 1:] * T))


def test_a_decay_is_found_from_far_away() -> None:
    measured = decay(np.array([[3.0, 0.8]]))[0]
    found = descend(lambda t: (decay(t) - measured) / 0.01, bounds((1e3, -10, 10), (1e3, 0, 10)), BLOCKS, np.array([0.5, 4.0]))
    assert found.theta == pytest.approx([3.0, 0.8], rel=1e-3)


def test_it_stays_within_its_bounds_and_solves_for_the_others_beside_them() -> None:
    measured = decay(np.array([[3.0, 0.8]]))[0]
    limits = bounds((1e3, -10, 10), (1e3, 0, 0.5))
    found = descend(lambda t: (decay(t) - measured) / 0.01, limits, BLOCKS, np.array([0.5, 0.1]))
    assert found.theta[1] == 0.5
    best = np.exp(-0.5 * T) @ measured / (np.exp(-0.5 * T) @ np.exp(-0.5 * T))
    assert found.theta[0] == pytest.approx(best, rel=0.1)  # outliers count less than squares


def test_what_the_data_do_not_say_the_prior_says() -> None:
    found = descend(lambda t: 0.0 * t[:, :1] + np.zeros((len(t), 200)), bounds((0.1, -1, 1)), BLOCKS, np.array([0.05]))
    assert found.theta == pytest.approx([0.0], abs=1e-4)
    assert found.known == pytest.approx([0.0], abs=1e-6)
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(0.1, rel=0.01)


def test_the_interval_covers_what_was_there() -> None:
    inside = 0
    for seed in range(60):
        noise = np.random.default_rng(seed).standard_normal(200)
        measured = 2.0 * T + noise
        found = descend(lambda t, m=measured: t * T - m, bounds((1e3, -10, 10)), BLOCKS, np.array([0.0]))
        inside += abs(found.theta[0] - 2.0) < 1.645 * np.sqrt(found.covariance[0, 0])
    assert 46 <= inside <= 60  # 54 expected


def test_spikes_hardly_move_it() -> None:
    measured = 2.0 * T + np.random.default_rng(1).standard_normal(200)
    measured[::25] += 500.0
    found = descend(lambda t: t * T - measured, bounds((1e3, -10, 10)), BLOCKS, np.array([0.0]))
    assert found.theta[0] == pytest.approx(2.0, abs=0.25)
