"""The workpiece between two tools: what is left of the stock. A value: cutting it gives another one."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from twin.engagement.cells import NONE, Cells, height_at
from twin.engagement.sweep import COLUMNS, Floats
from twin.errors import EngagementError
from twin.kernels.compiling import kernel
from twin.machine import Stock

CELLS_MAX = 8_000_000


@dataclass(frozen=True, slots=True)
class Workpiece:
    """The rest of a stock, in machine coordinates.

    cells: where tools have been, the stock as cells and sweeps (cells.py); the rest of the stock is whole
    cells_max: limit of the number of cells; 12 bytes each

    >>> plate = Workpiece.of(Stock(min_mm=(0, 0, -10), max_mm=(40, 30, 0)), cell_mm=0.5)
    >>> plate.volume_mm3()
    12000.0
    """

    cells: Cells
    cells_max: int = CELLS_MAX

    @classmethod
    def of(cls, stock: Stock | None, cell_mm: float, cells_max: int = CELLS_MAX) -> Self:
        """The whole stock; None = there is nothing to cut.

        cell_mm: side of a cell. It has no influence on any result, only on time and memory: a sixteenth of the diameter of the
        tool that cuts most is a good choice.
        """
        if not (math.isfinite(cell_mm) and cell_mm > 0.0):
            raise EngagementError(f"cell_mm {cell_mm} is no size; a sixteenth of the tool's diameter is a good one")
        low, high = (stock.min_mm, stock.max_mm) if stock is not None else ((0.0, 0.0, -math.inf), (0.0, 0.0, -math.inf))
        nothing = np.empty(0, np.int32)
        cells = Cells(
            float(low[0]), float(low[1]), float(cell_mm),
            float(low[0]), float(low[1]), float(low[2]), float(high[0]), float(high[1]), float(high[2]),
            np.empty((0, 0)), np.empty((0, 0), np.int32), nothing, nothing, np.empty((0, COLUMNS)), np.array([0, 0, NONE]),
        )  # fmt: skip
        return cls(cells, cells_max)

    def height_mm(self, points_mm: Floats) -> Floats:
        """z of the surface (n,) at points (n, 2): exact. Outside the stock its bottom."""
        return _heights(self.cells, np.ascontiguousarray(points_mm, dtype=np.float64))

    def volume_mm3(self, samples: int = 16) -> float:
        """Return the volume. A cell with a wall in it is sampled at `samples`² points; the others are exact. 0: no stock."""
        cells = self.cells
        if not math.isfinite(cells.high_z):
            return 0.0
        whole = (cells.high_x - cells.low_x) * (cells.high_y - cells.low_y) * (cells.high_z - cells.low_z)
        return float(whole - _removed(cells, samples))

    def made_ready(self, points_mm: Floats, radius_mm: float) -> Cells:
        """A copy of the cells that covers the path (n, 3) of a tool, with room for its sweeps.

        Raises EngagementError if there would be more than `cells_max`.
        """
        old = self.cells
        floor, head, x, y = old.floor.copy(), old.head.copy(), old.x, old.y
        first, count = self._needed(points_mm, radius_mm)
        if count[0] * count[1] > self.cells_max:
            coarse = old.side
            while (count[0] * old.side / coarse + 2) * (count[1] * old.side / coarse + 2) > self.cells_max:
                coarse *= 1.02
            raise EngagementError(
                f"the way over the stock takes {count[0]} × {count[1]} cells of {old.side:g} mm, more than cells_max "
                f"{self.cells_max}; Workpiece.of(stock, cell_mm={coarse * 1.01:.3g}) is coarse enough, with the same engagement"
            )
        if count != floor.shape:
            place = np.s_[-first[0] : floor.shape[0] - first[0], -first[1] : floor.shape[1] - first[1]]
            floor, head = np.full(count, old.high_z), np.full(count, NONE, np.int32)
            if old.floor.size:
                floor[place], head[place] = old.floor, old.head
            x, y = old.x + first[0] * old.side, old.y + first[1] * old.side
        used = int(old.used[0])
        sweeps = np.empty((used + len(points_mm) + 1, COLUMNS))
        sweeps[:used] = old.sweeps[:used]
        return old._replace(
            x=x, y=y, floor=floor, head=head, link=old.link.copy(), owner=old.owner.copy(), sweeps=sweeps, used=old.used.copy()
        )

    def _needed(self, points_mm: Floats, radius_mm: float) -> tuple[tuple[int, int], tuple[int, int]]:
        """First cell, counted from the present first, and number of cells, in x and y, that the cells so far and a path cover."""
        cells = self.cells
        firsts, counts = [], []
        sides = ((cells.x, cells.low_x, cells.high_x), (cells.y, cells.low_y, cells.high_y))
        for axis, (corner, low, high) in enumerate(sides):
            first, last = 0, cells.floor.shape[axis]
            if points_mm[:, 2].min() < cells.high_z:
                lowest = max(float(points_mm[:, axis].min()) - radius_mm, low)
                highest = min(float(points_mm[:, axis].max()) + radius_mm, high)
                if lowest < highest:
                    begin, end = math.floor((lowest - corner) / cells.side), math.ceil((highest - corner) / cells.side)
                    first, last = (min(first, begin), max(last, end)) if last else (begin, end)
            firsts.append(first)
            counts.append(last - first)
        return (firsts[0], firsts[1]), (counts[0], counts[1])


@kernel
def _heights(cells: Cells, points: Floats) -> Floats:
    heights = np.empty(len(points))
    for k in range(len(points)):
        heights[k] = height_at(cells, points[k, 0], points[k, 1], -math.inf)
    return heights


@kernel
def _removed(cells: Cells, samples: int) -> float:
    """The volume that has been taken away, cell by cell, each as far as it lies in the stock."""
    total = 0.0
    for i in range(cells.floor.shape[0]):
        left, right = max(cells.low_x, cells.x + i * cells.side), min(cells.high_x, cells.x + (i + 1) * cells.side)
        for j in range(cells.floor.shape[1]):
            front, back = max(cells.low_y, cells.y + j * cells.side), min(cells.high_y, cells.y + (j + 1) * cells.side)
            depth = cells.high_z - max(cells.floor[i, j], cells.low_z)
            if cells.head[i, j] != NONE:
                depth = 0.0
                for p in range(samples):
                    for q in range(samples):
                        x, y = left + (p + 0.5) * (right - left) / samples, front + (q + 0.5) * (back - front) / samples
                        depth += (cells.high_z - height_at(cells, x, y, -math.inf)) / samples**2
            total += depth * (right - left) * (back - front)
    return total
