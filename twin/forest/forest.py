"""A forest as arrays: trees that lead a row of features to one value each, and the sum of these values."""

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from twin.forest.errors import ForestError
from twin.forest.kernels import LANES, Floats, Longs, levels_of, total_of_row, totals_of_rows

FEATURES_MAX = 254
TREE_NODES_MAX = 2**23
LEVELS_MAX = 64
HIGHEST_KEY = np.int32(2**31 - 1)

FORMATS: dict[str, tuple[type[np.generic], int]] = {
    "child": (np.int32, 1),
    "feature": (np.int16, 1),
    "threshold": (np.float32, 1),
    "leaf": (np.int32, 1),
    "values": (np.float64, 1),
    "tree_nodes": (np.int32, 1),
    "scaling": (np.float64, 2),
}


@dataclass(frozen=True, slots=True, eq=False)
class Forest:
    """Trees as the kernels walk through them; `arrays` tells them in plain terms, `forest_of_arrays` makes them.

    nodes: (n + 1,) packed (twin/forest/kernels.py), tree by tree, the last one nothing; groups: (g, LANES + 1) eight roots
    and the levels below them; values: (v + 1,), the last one 0; scaling: (2, features): x = (row − scaling[0]) / scaling[1];
    tree_nodes: (t,) nodes of each tree; row: how a row is written as float64
    """

    nodes: Longs
    groups: Longs
    values: Floats
    scaling: Floats
    tree_nodes: NDArray[np.int32]
    row: struct.Struct

    @property
    def features(self) -> int:
        """The number of features in a row."""
        return int(self.scaling.shape[1])

    @property
    def trees(self) -> int:
        """The number of trees."""
        return len(self.tree_nodes)

    def total_one(self, row: Sequence[float]) -> float:
        """Sum over the trees for one row. Raises ForestError where it has not one finite number for each feature."""
        try:
            numbers = np.frombuffer(self.row.pack(*row))
        except struct.error:
            self._refuse(row)
        total: float = total_of_row(self.nodes, self.groups, self.values, self.scaling, numbers)
        if math.isnan(total):
            self._refuse(row)
        return total

    def totals(self, rows: Floats) -> Floats:
        """(n,) of rows (n, features), in float64. Raises ForestError where a value is not finite."""
        rows = np.ascontiguousarray(rows, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != self.features:
            raise ForestError(
                f"rows of shape {rows.shape}: the forest was trained on {self.features} features, so (n, {self.features})"
            )
        totals: Floats = totals_of_rows(self.nodes, self.groups, self.values, self.scaling, rows)
        if len(bad := np.flatnonzero(np.isnan(totals))):
            self._refuse(rows[bad[0]].tolist(), f"row {bad[0]}: ")
        return totals

    def _refuse(self, row: Sequence[Any], where: str = "") -> NoReturn:
        if len(row) != self.features:
            raise ForestError(f"{where}{len(row)} values: the forest was trained on {self.features} features")
        for number, (value, center, scale) in enumerate(zip(row, *self.scaling, strict=True)):
            with np.errstate(all="ignore"):
                if not isinstance(value, int | float | np.number) or not np.isfinite(np.float32((value - center) / scale)):
                    raise ForestError(
                        f"{where}feature {number} is {value}: a forest scores finite numbers only, leave the row out"
                    )
        raise AssertionError("a finite row has a finite total")

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that `forest_of_arrays` takes, see there."""
        nodes = self.nodes[:-1]
        child, low = (nodes >> 40).astype(np.int32), nodes.astype(np.int32)  # the lower half
        is_leaf = child == 0
        bits = np.where(is_leaf, 0, np.where(low >= 0, low, low ^ HIGHEST_KEY)).astype(np.int32)
        return {
            "child": child,
            "feature": np.where(is_leaf, -1, (nodes >> 32) & 0xFF).astype(np.int16),
            "threshold": bits.view(np.float32),
            "leaf": np.where(is_leaf, low, -1).astype(np.int32),
            "values": self.values[:-1],
            "tree_nodes": self.tree_nodes,
            "scaling": self.scaling,
        }


@dataclass(frozen=True, slots=True, eq=False)
class _Plain:
    """The arrays of a file."""

    child: NDArray[np.int32]
    feature: NDArray[np.int16]
    threshold: NDArray[np.float32]
    leaf: NDArray[np.int32]
    values: Floats
    tree_nodes: NDArray[np.int32]
    scaling: Floats


def forest_of_arrays(arrays: Mapping[str, NDArray[Any]]) -> Forest:
    """The forest of these arrays, checked: the kernels look at no bounds. Raises ForestError where they are no forest.

    Trees stand one after the other, the root first, the two children of a node side by side somewhere after it:
    child: (n,) how many nodes further on the left child stands, 0 in a leaf; feature: (n,), −1 in a leaf; threshold: (n,) of
    float32: left where float32(x) ≤ threshold, x the scaled feature; leaf: (n,) number of the value, −1 where there is none;
    values: (v,); tree_nodes: (t,) nodes of each tree; scaling: (2, features): x = (row − scaling[0]) / scaling[1]
    """
    for name, (kind, dimensions) in FORMATS.items():
        if name not in arrays:
            raise ForestError(f"the forest has no array {name!r}")
        if arrays[name].dtype != kind or arrays[name].ndim != dimensions:
            found = f"{arrays[name].dtype}, {arrays[name].ndim}-dimensional"
            raise ForestError(f"the forest's {name} is {found}; it has to be {kind.__name__}")
    plain = _Plain(**{name: np.ascontiguousarray(arrays[name]) for name in FORMATS})
    if fault := _fault(plain):
        raise ForestError(f"not a forest: {fault}")
    features, is_leaf = plain.scaling.shape[1], plain.child == 0
    bits = (plain.threshold + np.float32(0.0)).view(np.int32)  # −0 is 0
    low = np.where(is_leaf, plain.leaf, np.where(bits >= 0, bits, bits ^ HIGHEST_KEY)).astype(np.int64)
    feature = np.where(is_leaf, features, plain.feature).astype(np.int64)
    nothing = (np.int64(features) << 32) | len(plain.values)
    nodes = np.append((plain.child.astype(np.int64) << 40) | (feature << 32) | (low & 0xFFFFFFFF), nothing)
    row = struct.Struct(f"{features}d")
    return Forest(nodes, _groups(plain), np.append(plain.values, 0.0), plain.scaling, plain.tree_nodes, row)


def _groups(plain: _Plain) -> Longs:
    """Roots of eight trees and the levels below them; the last group is filled up with trees that add nothing."""
    levels: Longs = levels_of(plain.child, plain.tree_nodes)
    if levels.max() > LEVELS_MAX:
        raise ForestError(f"a tree has more than {LEVELS_MAX} levels: limit its depth when you train it")
    roots = np.concatenate([[0], np.cumsum(plain.tree_nodes, dtype=np.int64)[:-1]])
    spare = -len(roots) % LANES
    roots = np.append(roots, np.full(spare, len(plain.child))).reshape(-1, LANES)
    levels = np.append(levels, np.zeros(spare, np.int64)).reshape(-1, LANES).max(axis=1, keepdims=True)
    return np.ascontiguousarray(np.hstack([roots, levels]), dtype=np.int64)


def _fault(forest: _Plain) -> str:
    nodes = len(forest.child)
    if {len(forest.feature), len(forest.threshold), len(forest.leaf)} != {nodes}:
        return "child, feature, threshold and leaf have different lengths"
    if not len(forest.tree_nodes) or forest.tree_nodes.min() < 1 or int(forest.tree_nodes.sum(dtype=np.int64)) != nodes:
        return f"the trees' nodes do not add up to {nodes}"
    if forest.tree_nodes.max() > TREE_NODES_MAX:
        return f"a tree has more than {TREE_NODES_MAX} nodes"
    if forest.scaling.shape[0] != 2 or not 1 <= forest.scaling.shape[1] <= FEATURES_MAX:
        return f"scaling has shape {forest.scaling.shape}; there are 1 to {FEATURES_MAX} features"
    if not (np.isfinite(forest.scaling).all() and (forest.scaling[1] != 0.0).all()):
        return "the scaling is not finite, or divides by zero"
    if not (np.isfinite(forest.values).all() and np.isfinite(forest.threshold).all()):
        return "a threshold or a value is not finite"
    end = np.repeat(np.cumsum(forest.tree_nodes, dtype=np.int64), forest.tree_nodes)
    is_leaf = forest.child == 0
    if not ((forest.child >= 0) & (is_leaf | (np.arange(nodes) + forest.child.astype(np.int64) + 1 < end))).all():
        return "a child stands outside its tree"
    if not (is_leaf | ((forest.feature >= 0) & (forest.feature < forest.scaling.shape[1]))).all():
        return f"a node asks for a feature that is not among the {forest.scaling.shape[1]}"
    if not (~is_leaf | ((forest.leaf >= 0) & (forest.leaf < len(forest.values)))).all():
        return "a leaf has no value"
    return ""
