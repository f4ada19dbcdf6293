"""Arrays are a forest, or are refused: the kernels look at no bounds."""

from typing import Any

import numpy as np
import pytest

from tests.twin.forest.forests import isolation
from twin.forest.errors import ForestError
from twin.forest.flattening import flatten_isolation
from twin.forest.forest import Forest, forest_of_arrays

STUMP: dict[str, Any] = {
    "child": np.array([1, 0, 0], np.int32),
    "feature": np.array([0, -1, -1], np.int16),
    "threshold": np.array([2.0, 0.0, 0.0], np.float32),
    "leaf": np.array([-1, 0, 1], np.int32),
    "values": np.array([10.0, 20.0]),
    "tree_nodes": np.array([3], np.int32),
    "scaling": np.array([[0.0], [1.0]]),
}


def stump(**other: Any) -> Forest:
    return forest_of_arrays({**STUMP, **other})


def test_a_stump_is_left_up_to_its_threshold_and_right_beyond_it() -> None:
    assert [stump().total_one([x]) for x in (1.0, 2.0, 2.0000001, 2.000001)] == [10.0, 10.0, 10.0, 20.0]  # as float32


def test_scaling_comes_first() -> None:
    halved = stump(scaling=np.array([[1.0], [2.0]]))
    assert [halved.total_one([x]) for x in (5.0, 5.1)] == [10.0, 20.0]


def test_trees_add_up() -> None:
    three = {name: np.concatenate([STUMP[name]] * 3) for name in ("child", "feature", "threshold", "leaf", "tree_nodes")}
    assert stump(**three).totals(np.array([[1.0], [3.0]])).tolist() == [30.0, 60.0]


FAULTS: dict[str, tuple[str, Any, str]] = {
    "a child beyond the tree": ("child", np.array([2, 0, 0], np.int32), "outside its tree"),
    "a child before its parent": ("child", np.array([-1, 0, 0], np.int32), "outside its tree"),
    "a feature that is not there": ("feature", np.array([1, -1, -1], np.int16), "not among the 1"),
    "a leaf without a value": ("leaf", np.array([-1, 0, 2], np.int32), "no value"),
    "a leaf with a negative value number": ("leaf", np.array([-1, 0, -1], np.int32), "no value"),
    "a threshold that is not finite": ("threshold", np.array([np.nan, 0.0, 0.0], np.float32), "not finite"),
    "a value that is not finite": ("values", np.array([1.0, np.inf]), "not finite"),
    "a scale of zero": ("scaling", np.zeros((2, 1)), "divides by zero"),
    "trees that do not add up": ("tree_nodes", np.array([2], np.int32), "do not add up"),
    "no trees": ("tree_nodes", np.array([], np.int32), "do not add up"),
    "other lengths": ("leaf", np.array([-1, 0], np.int32), "different lengths"),
    "another type": ("child", np.array([1, 0, 0], np.int64), "child is int64"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_what_would_lead_a_kernel_astray_is_refused(case: str) -> None:
    name, array, message = FAULTS[case]
    with pytest.raises(ForestError, match=message):
        stump(**{name: array})


def test_a_missing_array_is_named() -> None:
    with pytest.raises(ForestError, match="'values'"):
        forest_of_arrays({name: array for name, array in STUMP.items() if name != "values"})


def test_a_tree_of_too_many_levels_is_refused() -> None:
    nodes = 2 * 70 + 1
    child = np.array([1 - i % 2 for i in range(nodes - 1)] + [0], np.int32)  # each right child leads on
    rest = {"feature": np.zeros(nodes, np.int16), "threshold": np.zeros(nodes, np.float32), "leaf": np.zeros(nodes, np.int32)}
    with pytest.raises(ForestError, match="more than 64 levels"):
        stump(child=child, tree_nodes=np.array([nodes], np.int32), **rest)


def test_what_a_forest_tells_of_itself_makes_the_same_forest() -> None:
    told = flatten_isolation(isolation(9)).forest.arrays()
    again = forest_of_arrays(told).arrays()
    assert list(again) == list(told)
    for name, array in told.items():
        assert np.array_equal(again[name], array), name
        assert again[name].dtype == array.dtype
