"""The region of training rows: their ranges, prototypes that cover them, and how far rows are from those of other times."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from twin.residual.errors import ResidualError
from twin.residual.region import Region

Floats = NDArray[np.float64]
PROTOTYPES = 1000
INSIDE = 0.99
"""Share of the training rows that the limit holds inside, each beside rows of other blocks of time only."""
MARGIN = 0.02
"""Part of its range by which a feature may go beyond it."""


def region_of(rows: Floats, block: NDArray[np.int64], weight: Floats | None = None, inside: float = INSIDE) -> Region:
    """The region of training rows (n, f) of blocks of time (n,). weight: (f,) how much a feature counts in the distance"""
    low, high = rows.min(axis=0), rows.max(axis=0)
    beyond = MARGIN * (high - low)
    spread = rows.std(axis=0)
    scale = np.where(spread > 0.0, 1.0 / np.where(spread > 0.0, spread, 1.0), 0.0)
    if weight is not None:
        scale = scale * weight
    scaled = np.ascontiguousarray(rows * scale)
    prototypes = scaled[_covering(scaled, PROTOTYPES)]
    limit = float(np.quantile(_from_other_blocks(scaled, block), inside))
    # A training row is nearer to all rows than to the prototypes among them: as much is allowed for.
    apart = cKDTree(prototypes).query(scaled)[0]
    return Region(low - beyond, high + beyond, scale, prototypes, np.array([max(limit, float(np.quantile(apart, inside)))]))


def _covering(scaled: Floats, count: int) -> NDArray[np.int64]:
    """Rows that cover the others, each the furthest from those before it (Gonzalez, 1985)."""
    chosen = [int(np.argmin(((scaled - np.median(scaled, axis=0)) ** 2).sum(axis=1)))]
    square = np.full(len(scaled), np.inf)
    while len(chosen) < min(count, len(scaled)):
        square = np.minimum(square, ((scaled - scaled[chosen[-1]]) ** 2).sum(axis=1))
        furthest = int(np.argmax(square))
        if square[furthest] == 0.0:
            break
        chosen.append(furthest)
    return np.array(chosen, dtype=np.int64)


def _from_other_blocks(scaled: Floats, block: NDArray[np.int64]) -> Floats:
    """Distance of each row to the nearest of another block, (n,): its own neighbours in time do not count."""
    names = np.unique(block)
    if len(names) < 2:
        raise ResidualError("the training time is one block: nothing tells how far rows of another time are; record more")
    distance = np.empty(len(scaled))
    for name in names:
        own = block == name
        distance[own] = cKDTree(scaled[~own]).query(scaled[own])[0]
    return distance
