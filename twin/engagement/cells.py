"""The stock as cells, each with the exact sweeps that reach into it.

A height map with one height a cell is off by up to a cell at every wall, and an angle by much more where tool and wall are
nearly tangent. So a cell keeps two things: `floor`, a height that the whole cell has been cut to, and a list of the sweeps that
cut lower in a part of the cell. The height of a point is the lowest of the two, exactly. A sweep that covers a cell becomes its
floor and clears its list, so that lists stay short: they are left along walls only. The size of a cell has no influence on any
result.

Lists are chains in a pool: `head[i, j]` is an entry, `link[entry]` the next one, `owner[entry]` its sweep.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.engagement.sweep import (
    LENGTH,
    RADIUS,
    UX,
    UY,
    Floats,
    X,
    Y,
    contains,
    highest_in_square,
    lowest_at,
    lowest_between,
    lowest_in_square,
)
from twin.kernels.compiling import kernel

Indices = NDArray[np.int32]
NONE = -1
SWEEPS, ENTRIES, FREE = range(3)


class Cells(NamedTuple):
    """The state. Arrays are changed in place by `remove`; everything is in mm.

    x, y: lower left corner of cell (0, 0); side: of a cell
    low_x … high_z: the stock; beyond it there is no material, and beyond the cells it is as it was
    floor: (nx, ny); head: (nx, ny); link, owner: (entries,); sweeps: (sweeps, 8)
    used: sweeps in use, entries ever used, first free entry
    """

    x: float
    y: float
    side: float
    low_x: float
    low_y: float
    low_z: float
    high_x: float
    high_y: float
    high_z: float
    floor: Floats
    head: Indices
    link: Indices
    owner: Indices
    sweeps: Floats
    used: NDArray[np.int64]


@kernel
def height_at(cells: Cells, x: float, y: float, enough: float) -> float:
    """Height of the material at (x, y), exact where above `enough`, else some value ≤ that; its bottom outside the stock."""
    if x <= cells.low_x or x >= cells.high_x or y <= cells.low_y or y >= cells.high_y:
        return cells.low_z
    i, j = math.floor((x - cells.x) / cells.side), math.floor((y - cells.y) / cells.side)
    if i < 0 or j < 0 or i >= cells.floor.shape[0] or j >= cells.floor.shape[1]:
        return cells.high_z
    height = float(cells.floor[i, j])
    entry = cells.head[i, j]
    while entry != NONE and height > enough:
        height = min(height, lowest_at(cells.sweeps, cells.owner[entry], x, y))
        entry = cells.link[entry]
    return max(height, cells.low_z)


@kernel
def span(cells: Cells, k: int, start: float) -> tuple[int, int, int, int]:
    """The cells (first and past last in x, in y) that sweep `k` can reach from the position `start` on."""
    sweep = cells.sweeps[k]
    ax, ay = sweep[X] + sweep[UX] * start, sweep[Y] + sweep[UY] * start
    bx, by = sweep[X] + sweep[UX] * sweep[LENGTH], sweep[Y] + sweep[UY] * sweep[LENGTH]
    radius = sweep[RADIUS]
    first_i = math.floor((min(ax, bx) - radius - cells.x) / cells.side)
    first_j = math.floor((min(ay, by) - radius - cells.y) / cells.side)
    last_i = math.floor((max(ax, bx) + radius - cells.x) / cells.side)
    last_j = math.floor((max(ay, by) + radius - cells.y) / cells.side)
    nx, ny = cells.floor.shape
    return max(first_i, 0), min(last_i + 1, nx), max(first_j, 0), min(last_j + 1, ny)


@kernel
def remove(cells: Cells, k: int, start: float) -> None:
    """Take away what sweep `k` removes from the position `start` on. The pool must have room for an entry in each cell."""
    first_i, last_i, first_j, last_j = span(cells, k, start)
    sweeps, side = cells.sweeps, cells.side
    lowest = lowest_between(sweeps, k, start, sweeps[k, LENGTH])
    ax, ay = sweeps[k, X] + sweeps[k, UX] * start, sweeps[k, Y] + sweeps[k, UY] * start
    length = sweeps[k, LENGTH] - start
    reach = (sweeps[k, RADIUS] + side * 0.7072) ** 2
    for i in range(first_i, last_i):
        for j in range(first_j, last_j):
            if cells.floor[i, j] <= lowest:
                continue
            x, y = cells.x + i * side, cells.y + j * side
            dx, dy = x + side / 2.0 - ax, y + side / 2.0 - ay
            along = dx * sweeps[k, UX] + dy * sweeps[k, UY]
            beyond = along if along < 0.0 else max(along - length, 0.0)
            if beyond * beyond + (dx * sweeps[k, UY] - dy * sweeps[k, UX]) ** 2 >= reach:
                continue
            highest = highest_in_square(sweeps, k, x, y, side)
            if highest < cells.floor[i, j]:
                cells.floor[i, j] = highest
                _drop_what_is_above(cells, i, j, highest)
            if lowest_in_square(sweeps, k, x, y, side) < cells.floor[i, j]:
                _enter(cells, k, i, j)


@kernel
def _drop_what_is_above(cells: Cells, i: int, j: int, floor: float) -> None:
    """Sweeps that cut nothing below the floor any more leave the list of the cell."""
    x, y = cells.x + i * cells.side, cells.y + j * cells.side
    before, entry = NONE, cells.head[i, j]
    while entry != NONE:
        following = cells.link[entry]
        if lowest_in_square(cells.sweeps, cells.owner[entry], x, y, cells.side) >= floor:
            _unlink(cells, i, j, before, entry)
        else:
            before = entry
        entry = following


@kernel
def _unlink(cells: Cells, i: int, j: int, before: int, entry: int) -> None:
    if before == NONE:
        cells.head[i, j] = cells.link[entry]
    else:
        cells.link[before] = cells.link[entry]
    cells.link[entry] = cells.used[FREE]
    cells.used[FREE] = entry


@kernel
def _enter(cells: Cells, k: int, i: int, j: int) -> None:
    """Put sweep `k` at the head of the list, unless it is there already.

    The former head has grown to its full length by now, so this is the time to drop the older ones that it contains: passes over
    the same contour, layer by layer, don't add up.
    """
    head = cells.head[i, j]
    if head != NONE:
        if cells.owner[head] == k:
            return
        before, entry = head, cells.link[head]
        while entry != NONE:
            following = cells.link[entry]
            if contains(cells.sweeps, cells.owner[head], cells.owner[entry]):
                _unlink(cells, i, j, before, entry)
            else:
                before = entry
            entry = following
    entry = cells.used[FREE]
    if entry != NONE:
        cells.used[FREE] = cells.link[entry]
    else:
        entry = cells.used[ENTRIES]
        cells.used[ENTRIES] += 1
    cells.owner[entry] = k
    cells.link[entry] = head
    cells.head[i, j] = entry
