"""Knots of a table over one or two arguments, and the linear interpolation between them.

Beyond its ends a table goes on as it ends; an argument with a period comes round again.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from twin.learned.words import PERIODS

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Knots:
    """The knots of each argument, by its column, increasing; those of a period start at 0 and stay below it."""

    by_column: Mapping[str, Floats]

    @property
    def columns(self) -> tuple[str, ...]:
        """The arguments, in the order of the table."""
        return tuple(self.by_column)

    @property
    def shape(self) -> tuple[int, ...]:
        """Knots of each argument."""
        return tuple(len(knots) for knots in self.by_column.values())

    @property
    def count(self) -> int:
        """Knots of the whole table."""
        return int(np.prod(self.shape))

    def interpolated(self, values: Floats, arguments: Mapping[str, Floats]) -> Floats:
        """Return the table at the arguments, (lanes, n), from its values at the knots, (lanes, count), last argument fastest.

        >>> Knots({"position_mm": np.array([0.0, 10.0])}).interpolated(
        ...     np.array([[1.0, 3.0]]), {"position_mm": np.array([-5.0, 5.0, 10.0])})
        array([[1., 2., 3.]])
        """
        sides = [_sides(arguments[column], knots, PERIODS.get(column)) for column, knots in self.by_column.items()]
        found: Floats = np.zeros((len(values), len(sides[0][0][0])))
        for corner in product((0, 1), repeat=len(sides)):
            index = np.zeros(found.shape[1], dtype=np.intp)
            weight = np.ones(found.shape[1])
            for side, both, length in zip(corner, sides, self.shape, strict=True):
                index = index * length + both[side][0]
                weight = weight * both[side][1]
            found += values[:, index] * weight
        return found


Side = tuple[NDArray[np.intp], Floats]


def _sides(at: Floats, knots: Floats, period: float | None) -> tuple[Side, Side]:
    """The knot before and after each argument, (n,), with its weight."""
    count = len(knots)
    at = np.nan_to_num(at)
    if count == 1:
        zero = np.zeros(len(at), dtype=np.intp)
        return (zero, np.ones(len(at))), (zero, np.zeros(len(at)))
    if period is not None:
        turned = np.mod(at - knots[0], period) + knots[0]
        ends = np.append(knots, knots[0] + period)
        before = np.clip(np.searchsorted(ends, turned, side="right") - 1, 0, count - 1)
        part = (turned - ends[before]) / (ends[before + 1] - ends[before])
        return (before, 1.0 - part), ((before + 1) % count, part)
    before = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, count - 2)
    part = np.clip((at - knots[before]) / (knots[before + 1] - knots[before]), 0.0, 1.0)
    return (before, 1.0 - part), (before + 1, part)
