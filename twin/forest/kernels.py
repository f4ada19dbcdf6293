"""The walk through the trees, compiled.

A tree decides float32(x) ≤ threshold, the threshold a float64. Rounded down to a float32 it decides the same, and as a 32-bit
integer in the order of the floats (`key`) it decides without a floating-point comparison. A node is one 64-bit integer:

    bits 40-62  how many nodes further on its two children stand, side by side: left, right; 0 in a leaf
    bits 32-39  the feature; in a leaf one past the last, whose key is the lowest of all
    bits  0-31  the threshold's key; in a leaf the number of its value

so that next = at + offset + (key of the feature > threshold) is the same step in a node and in a leaf, which leads to itself.
There is nothing to guess for the processor: every tree of a group takes as many steps as the deepest of them, and eight walks are
under way at a time, each waiting for memory while the others go on. A select would be compiled to a branch here; the sum of an
index and a comparison is not. Values are added in the order of the trees, as scikit-learn adds them.
"""

import numpy as np
from numpy.typing import NDArray

from twin.kernels.compiling import kernel

Floats = NDArray[np.float64]
Integers = NDArray[np.int32]
Longs = NDArray[np.int64]

LANES = 8
ROWS_IN_HAND = 128  # whose keys stay in the nearest cache while a tree is walked for all of them
ROWS_WORTH_A_TREE = 48  # fewer are walked one by one: to fetch a tree costs more than it saves
FLOAT32_MAX = np.float32(3.4028235e38)
LOWEST_KEY = np.int32(-(2**31))


@kernel
def keys_of(row: Floats, scaling: Floats, keys: Integers) -> bool:
    """Fills in the keys (features + 1,) of the scaled row; False where a feature is no finite float32."""
    features = len(row)
    for f in range(features):
        x = np.float32((row[f] - scaling[0, f]) / scaling[1, f])
        if not abs(x) <= FLOAT32_MAX:
            return False
        bits = np.float32(x + np.float32(0.0)).view(np.int32)  # −0 is 0
        keys[f] = bits if bits >= 0 else bits ^ np.int32(0x7FFFFFFF)
    keys[features] = LOWEST_KEY
    return True


@kernel
def levels_of(child: Integers, tree_nodes: Integers) -> Longs:
    """(t,) steps from the root to the deepest leaf of each tree; a child stands after its parent."""
    levels = np.zeros(len(tree_nodes), np.int64)
    depth = np.zeros(len(child), np.int64)
    at = 0
    for tree in range(len(tree_nodes)):
        for node in range(at, at + tree_nodes[tree]):
            levels[tree] = max(levels[tree], depth[node])
            if child[node] > 0:
                left = node + child[node]
                depth[left] = max(depth[left], depth[node] + 1)
                depth[left + 1] = max(depth[left + 1], depth[node] + 1)
        at += tree_nodes[tree]
    return levels


@kernel
def step(nodes: Longs, keys: Integers, at: np.uint64) -> np.uint64:
    """The node after this one."""
    node = nodes[at]
    right = keys[np.uint64((node >> 32) & 0xFF)] > np.int32(node)
    return at + np.uint64(node >> 40) + np.uint64(right)


@kernel
def value_at(nodes: Longs, values: Floats, at: np.uint64) -> float:
    """The value of a leaf."""
    value: float = values[np.uint64(np.int32(nodes[at]))]
    return value


@kernel
def total_by_keys(nodes: Longs, groups: Longs, values: Floats, keys: Integers) -> float:
    """Sum of the leaves' values over all trees, in their order. groups: (g, LANES + 1), eight roots and the levels below them."""
    total = 0.0
    for g in range(len(groups)):
        a, b, c, d = np.uint64(groups[g, 0]), np.uint64(groups[g, 1]), np.uint64(groups[g, 2]), np.uint64(groups[g, 3])
        p, q, r, s = np.uint64(groups[g, 4]), np.uint64(groups[g, 5]), np.uint64(groups[g, 6]), np.uint64(groups[g, 7])
        for _ in range(groups[g, LANES]):
            a, b, c, d = step(nodes, keys, a), step(nodes, keys, b), step(nodes, keys, c), step(nodes, keys, d)
            p, q, r, s = step(nodes, keys, p), step(nodes, keys, q), step(nodes, keys, r), step(nodes, keys, s)
        total += value_at(nodes, values, a)
        total += value_at(nodes, values, b)
        total += value_at(nodes, values, c)
        total += value_at(nodes, values, d)
        total += value_at(nodes, values, p)
        total += value_at(nodes, values, q)
        total += value_at(nodes, values, r)
        total += value_at(nodes, values, s)
    return total


@kernel
def total_of_row(nodes: Longs, groups: Longs, values: Floats, scaling: Floats, row: Floats) -> float:
    """The sum for one row, NaN where a feature is no finite float32."""
    keys = np.empty(len(row) + 1, np.int32)
    return total_by_keys(nodes, groups, values, keys) if keys_of(row, scaling, keys) else np.nan


@kernel
def add_tree(nodes: Longs, values: Floats, root: np.uint64, levels: int, keys: Integers, totals: Floats) -> None:
    """Adds one tree's values to the totals of these rows, eight rows under way at a time; their number is a multiple of eight."""
    for i in range(0, len(totals), LANES):
        a, b, c, d, p, q, r, s = root, root, root, root, root, root, root, root
        for _ in range(levels):
            a, b, c, d = (
                step(nodes, keys[i], a),
                step(nodes, keys[i + 1], b),
                step(nodes, keys[i + 2], c),
                step(nodes, keys[i + 3], d),
            )
            p, q, r, s = (
                step(nodes, keys[i + 4], p),
                step(nodes, keys[i + 5], q),
                step(nodes, keys[i + 6], r),
                step(nodes, keys[i + 7], s),
            )
        totals[i] += value_at(nodes, values, a)
        totals[i + 1] += value_at(nodes, values, b)
        totals[i + 2] += value_at(nodes, values, c)
        totals[i + 3] += value_at(nodes, values, d)
        totals[i + 4] += value_at(nodes, values, p)
        totals[i + 5] += value_at(nodes, values, q)
        totals[i + 6] += value_at(nodes, values, r)
        totals[i + 7] += value_at(nodes, values, s)


@kernel
def totals_of_rows(nodes: Longs, groups: Longs, values: Floats, scaling: Floats, rows: Floats) -> Floats:
    """The sums for many rows, tree by tree for some rows at a time; NaN where a feature is no finite float32."""
    count, features = rows.shape
    totals = np.zeros(count)
    keys = np.zeros((ROWS_IN_HAND, features + 1), np.int32)
    good = np.ones(ROWS_IN_HAND, np.bool_)
    for start in range(0, count, ROWS_IN_HAND):
        here = min(ROWS_IN_HAND, count - start)
        for i in range(here):
            good[i] = keys_of(rows[start + i], scaling, keys[i])
            keys[i, features] = LOWEST_KEY
        whole = here - here % LANES if here >= ROWS_WORTH_A_TREE else 0
        if whole:
            for g in range(len(groups)):
                for lane in range(LANES):
                    root = np.uint64(groups[g, lane])
                    add_tree(nodes, values, root, groups[g, LANES], keys[:whole], totals[start : start + whole])
        for i in range(whole, here):
            totals[start + i] = total_by_keys(nodes, groups, values, keys[i])
        for i in range(here):
            if not good[i]:
                totals[start + i] = np.nan
    return totals
