"""Warping forgives a stall, not another shape."""

import numpy as np
import pytest

from benchmarks import synthetic_changes as drive
from twin.transient.warping import BAND, shape_of, warped_distance


def brute(left: np.ndarray, right: np.ndarray) -> float:  # type: ignore[type-arg]
    """Cheapest sum over all paths, by recursion."""
    n, m = len(left), len(right)
    cost = np.full((n, m), np.inf)
    for i in range(n):
        for j in range(m):
            before = min((cost[a, b] for a, b in ((i - 1, j - 1), (i - 1, j), (i, j - 1)) if a >= 0 and b >= 0), default=0.0)
            cost[i, j] = before + (left[i] - right[j]) ** 2
    return float(cost[-1, -1])


def test_the_path_is_the_cheapest_there_is() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        left, right = rng.standard_normal(7), rng.standard_normal(7)
        total = brute(left, right)
        found = warped_distance(left, right, 7)
        assert any(found == pytest.approx(np.sqrt(total / steps)) for steps in range(7, 14))


def test_a_stall_costs_little_and_another_shape_much() -> None:
    shape = shape_of(drive.changed(1.0, 0.0, 3.0))
    stalled = warped_distance(shape_of(drive.changed(1.0, 4.0, 3.5)), shape, BAND)
    other = warped_distance(shape_of(np.sin(np.linspace(0.0, 9.0, 120))), shape, BAND)
    assert stalled < 0.15 < 0.4 < other
    assert warped_distance(shape, shape, BAND) == 0.0


def test_size_offset_and_length_do_not_matter() -> None:
    change = drive.changed(1.0, 0.0, 3.0)
    np.testing.assert_allclose(shape_of(3.0 * change + 5.0), shape_of(change), atol=1e-9)
    assert shape_of(np.ones(50)).tolist() == [0.0] * 96
