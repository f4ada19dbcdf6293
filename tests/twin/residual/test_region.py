"""The region: rows of training are in it, what was never there is not, and it is said why."""

import numpy as np
import pytest

from tests.twin.residual.days import small_model
from twin.residual.errors import ResidualError
from twin.residual.region import region_of_arrays
from twin.residual.region_fit import region_of
from twin.residual.split import blocks_of

RNG = np.random.default_rng(5)
LINE = np.column_stack([np.linspace(0.0, 10.0, 2000)] * 2) + RNG.normal(0.0, 0.1, (2000, 2))
LINE_REGION = region_of(LINE[RNG.permutation(2000)], np.arange(2000) // 100)


def test_a_feature_beyond_its_range_is_named_with_the_range() -> None:
    outside = LINE_REGION.outside(np.array([5.0, 14.0]))
    assert outside is not None
    assert (outside.feature, outside.value) == (1, 14.0)
    assert outside.low == pytest.approx(-0.4, abs=0.4)
    assert outside.high == pytest.approx(10.4, abs=0.4)


def test_a_combination_that_never_was_is_outside_though_each_feature_is_in_its_range() -> None:
    outside = LINE_REGION.outside(np.array([2.0, 8.0]))
    assert outside is not None
    assert outside.low is None
    assert LINE_REGION.outside(np.array([5.0, 5.0])) is None


def test_rows_are_inside_together_as_they_are_one_by_one() -> None:
    rows = RNG.uniform(-2.0, 12.0, (300, 2))
    assert LINE_REGION.has(rows).tolist() == [LINE_REGION.outside(row) is None for row in rows]
    assert 0 < LINE_REGION.has(rows).sum() < 300


def test_later_rows_of_the_same_work_are_kept() -> None:
    assert small_model().model.held_out.in_region > 0.9


def test_one_block_of_time_tells_nothing_of_another() -> None:
    x = np.ones((50, 2))
    with pytest.raises(ResidualError, match="is one block"):
        region_of(x, blocks_of(np.arange(50.0), 100.0))


def test_a_feature_that_never_changed_has_no_say_within_its_range() -> None:
    rows = np.column_stack([LINE[:, 0], np.full(2000, 7.0)])
    region = region_of(rows, np.arange(2000) % 20)
    assert region.outside(np.array([5.0, 7.0])) is None
    assert region.outside(np.array([5.0, 7.1])) is not None


@pytest.mark.parametrize("name", ["low", "high", "scale", "prototypes", "limit"])
def test_arrays_of_another_shape_are_refused(name: str) -> None:
    arrays = LINE_REGION.arrays()
    with pytest.raises(ResidualError, match=f"the region's {name}"):
        region_of_arrays(arrays | {name: np.ones((3, 3, 3))}, 2)
    with pytest.raises(ResidualError, match=f"the region's {name}"):
        region_of_arrays(arrays | {name: np.full_like(arrays[name], np.nan)}, 2)
