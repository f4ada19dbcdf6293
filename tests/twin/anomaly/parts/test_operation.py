"""The test of an operation: t has a deviation of about 1 whatever the tick, and a fault that lasts shows twice."""

import numpy as np
import pytest
from scipy.signal import lfilter

from twin.anomaly.parts.operation import CLIP, begun_operation, both, clipped, gathered, statistic, together

LEVELS, CORRELATION = 0.5, 0.6
"""Deviation of what the levels foretell, in spreads; correlation of neighbouring ticks."""
ALIKE = (1.0 + CORRELATION) / (1.0 - CORRELATION)


def figures(operations: int, ticks: int, change: float = 0.0) -> list[float]:
    """Return t at the end of operations whose change is drawn from what the levels foretell, plus a fault."""
    rng, found = np.random.default_rng(5), []
    for _ in range(operations):
        noise = lfilter([np.sqrt(1.0 - CORRELATION**2)], [1.0, -CORRELATION], rng.standard_normal(ticks + 50))[50:]
        sums = begun_operation(1)
        for z in noise + change + rng.normal(0.0, LEVELS):
            sums = gathered(sums, (float(z),), (1.0,), ((0.0, 0.0),), 0.0)
        found.append(statistic(sums.total[0], sums.weight[0], LEVELS**2, ALIKE))
    return found


@pytest.mark.parametrize("ticks", [20, 60, 200])
def test_a_healthy_operation_has_a_deviation_of_one_at_any_tick(ticks: int) -> None:
    assert np.std(figures(400, ticks)) == pytest.approx(1.0, abs=0.12)


def test_a_change_stands_out_by_what_the_levels_leave_in_doubt() -> None:
    """A change of three deviations of the levels is one of three deviations, once the operation is long."""
    assert np.mean(figures(200, 400, change=3.0 * LEVELS)) == pytest.approx(3.0, abs=0.35)


def test_one_odd_operation_is_none_of_the_tool_and_little_of_the_last_four() -> None:
    assert both(9.0, 0.3) == 0.3
    assert together(9.0, [(0.1,), (-0.4,), (0.2,)], 0) == pytest.approx(0.5 * (CLIP - 0.1))
    assert clipped((9.0, -9.0, 1.0)) == (CLIP, -CLIP, 1.0)


def test_a_fault_that_lasts_shows_in_all_of_them() -> None:
    assert both(4.0, 3.5) == 3.5
    assert together(4.0, [(3.0,), (3.0,), (4.0,)], 0) == 7.0


def test_nothing_told_is_nothing_found() -> None:
    assert statistic(0.0, 0.0, 1.0, 4.0) == 0.0
