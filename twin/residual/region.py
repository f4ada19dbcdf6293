"""The region that a forest was trained on: outside of it a forest goes on saying what it said at the border, and is not asked.

A row x is inside where each feature is within the range that it had in training, and where the nearest of the prototypes,
training rows that cover all others, is no further than most training rows are from those of other times:

    min over prototypes p of  sum over f of  weight_f² ((x_f − p_f) / spread_f)²  ≤  limit²

Ranges see a feature that was never so large; the distance sees a combination that never was. `benchmarks/residual.py` measures
which rule refuses what is far off and keeps what is not.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.residual.errors import ResidualError

Floats = NDArray[np.float64]
ARRAYS = ("low", "high", "scale", "prototypes", "limit")


class Outside(NamedTuple):
    """Why a row is outside: the number of a feature, its value, its range; None where each is in its range, but not together."""

    feature: int
    value: float
    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """low, high: (f,) ranges; scale: (f,) weight/spread; prototypes: (p, f), scaled; limit: (1,) of the distance"""

    low: Floats
    high: Floats
    scale: Floats
    prototypes: Floats
    limit: Floats

    def outside(self, row: Floats) -> Outside | None:
        """Why the row (f,) is outside; None where it is inside."""
        off = np.flatnonzero((row < self.low) | (row > self.high))
        if len(off):
            at = int(off[0])
            return Outside(at, float(row[at]), float(self.low[at]), float(self.high[at]))
        nearest, square = nearest_of(row * self.scale, self.prototypes)
        if square <= self.limit[0] ** 2:
            return None
        at = int(np.argmax(np.abs(row * self.scale - self.prototypes[nearest])))
        return Outside(at, float(row[at]), None, None)

    def has(self, rows: Floats) -> NDArray[np.bool_]:
        """Return True for each of the rows (n, f) that is inside, (n,); as one by one."""
        inside = ((rows >= self.low) & (rows <= self.high)).all(axis=1)
        found = [bool(ranged) and self._is_near(row) for ranged, row in zip(np.asarray(inside), rows, strict=True)]
        return np.array(found, dtype=np.bool_)

    def _is_near(self, row: Floats) -> bool:
        return bool(nearest_of(row * self.scale, self.prototypes)[1] <= self.limit[0] ** 2)

    def arrays(self) -> dict[str, Floats]:
        """Return the arrays that `region_of_arrays` takes."""
        return {name: getattr(self, name) for name in ARRAYS}


def region_of_arrays(arrays: dict[str, NDArray[np.generic]], features: int) -> Region:
    """The region of these arrays. Raises ResidualError where they are none of so many features."""
    shapes = {"low": (features,), "high": (features,), "scale": (features,), "limit": (1,)}
    for name in ARRAYS:
        found = arrays.get(name)
        if found is None or found.dtype != np.float64 or found.shape != shapes.get(name, (len(found), features)):
            raise ResidualError(f"the region's {name} is not that of {features} features")
        if not np.isfinite(found).all() or not len(found):
            raise ResidualError(f"the region's {name} holds what is not a number")
    return Region(**{name: np.ascontiguousarray(arrays[name]) for name in ARRAYS})


def nearest_of(row: Floats, prototypes: Floats) -> tuple[int, float]:
    """The nearest prototype, and the square of the distance to it."""
    off = prototypes - row
    square = np.einsum("pf,pf->p", off, off)
    at = int(np.argmin(square))
    return at, float(square[at])
