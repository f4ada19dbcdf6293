"""Splits by time: later than all that is trained on, and further apart than the residual remembers."""

import numpy as np
import pytest

from tests.twin.residual.days import Floats, wandering
from twin.residual.errors import ResidualError
from twin.residual.features import PUBLISHED
from twin.residual.split import blocks_of, remembers_s, split_by_time
from twin.residual.table import table_of


def _wander(memory_s: float, count: int = 6000, seed: int = 3) -> tuple[Floats, Floats]:
    kept, value, found = np.exp(-60.0 / memory_s), 0.0, []
    for step in np.random.default_rng(seed).normal(size=count).tolist():
        value = kept * value + np.sqrt(1.0 - kept**2) * step
        found.append(value)
    return np.arange(count) * 60.0, np.array(found)


@pytest.mark.parametrize("memory_s", [300.0, 1800.0])
def test_memory_ends_where_the_autocorrelation_does(memory_s: float) -> None:
    t_s, residual = _wander(memory_s)
    found = remembers_s(t_s, residual, np.zeros(len(t_s), dtype=np.int64), 1e6)
    assert found == pytest.approx(memory_s * np.log(10.0), rel=0.5)  # e^(−t/τ) = 0.1


def test_everything_held_out_is_later_than_the_training_by_the_gap() -> None:
    table = table_of(wandering(1), PUBLISHED, 60.0)
    split = split_by_time(table.t_s, table.residual_k, table.stretch, 0.3, 640.0)
    assert table.t_s[split.test].min() - table.t_s[split.train].max() > split.gap_s
    assert split.gap_s >= 3 * 640.0
    assert split.gap_s >= remembers_s(table.t_s[split.train], table.residual_k[split.train], table.stretch[split.train], 40_000.0)
    assert len(split.test) == pytest.approx(0.3 * len(table.t_s), rel=0.01)


def test_a_shuffled_split_has_neighbours_on_both_sides() -> None:
    """What the gap keeps apart: of rows drawn by lot, nearly every one has a row of training within two minutes."""
    t_s = np.arange(6000) * 60.0
    drawn = np.random.default_rng(0).random(len(t_s)) < 0.3
    apart = np.abs(t_s[drawn][:, None] - t_s[~drawn][None, :]).min(axis=1)
    assert (apart <= 120.0).mean() > 0.95


def test_blocks_are_as_long_as_the_gap() -> None:
    t_s, residual = _wander(600.0)
    split = split_by_time(t_s, residual, np.zeros(len(t_s), dtype=np.int64), 0.3, 100.0)
    for block in np.unique(split.block):
        own = t_s[split.test][split.block == block]
        assert own.max() - own.min() <= split.gap_s
    assert split.blocks == len(np.unique(blocks_of(t_s[split.test], split.gap_s)))


def test_too_little_for_an_interval_is_refused_in_one_line() -> None:
    t_s, residual = _wander(3600.0, 300)
    with pytest.raises(ResidualError, match="an interval needs 8: record more"):
        split_by_time(t_s, residual, np.zeros(len(t_s), dtype=np.int64), 0.3, 2610.0)
