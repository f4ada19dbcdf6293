"""The tool on its way along a polyline: row by row, look at the rim, then take the material away."""

import math

import numpy as np
from numpy.typing import NDArray

from twin.engagement.cells import ENTRIES, NONE, SWEEPS, Cells, height_at, remove, span
from twin.engagement.rim import contact
from twin.engagement.sweep import LENGTH, RADIUS, SLOPE, UX, UY, Floats, X, Y, Z
from twin.kernels.compiling import kernel

ENTRIES_MAX = 30_000_000
"""Limit of the pool of list entries (8 bytes each). Layers of one contour don't add up unless their chords lie otherwise."""
UPRIGHT = 1e-6
"""A move that goes less than this part of its length sideways is a plunge or a retraction."""
STRAIGHT_MM = 1e-9
"""Segments that deviate less than this from the former one go on with its sweep."""
END_FACE_POINTS = 256
GOLDEN = math.pi * (3.0 - math.sqrt(5.0))
_ranks = np.arange(END_FACE_POINTS)
FACE_X = 0.9995 * np.sqrt((_ranks + 0.5) / END_FACE_POINTS) * np.cos(_ranks * GOLDEN)
FACE_Y = 0.9995 * np.sqrt((_ranks + 0.5) / END_FACE_POINTS) * np.sin(_ranks * GOLDEN)

DEPTH, ENTRY, EXIT, SECTION, DEEPEST, ARCS, UNIFORM, END_FACE, AXIAL_VOLUME = range(9)
COLUMNS = 9


@kernel
def _end_face(cells: Cells, x: float, y: float, radius: float, high: float, low: float) -> tuple[float, float]:
    """Area under the end face that meets material on the way from z = high down to low, and the volume of that material.

    Sampled at 256 points spread evenly over the face: exact to about 1 %. The outermost 0.05 % of the radius don't count, since
    a plunge along a wall that the tool itself has cut is one in air.
    """
    met, height = 0, 0.0
    low = max(low, cells.low_z)
    for point in range(END_FACE_POINTS):
        top = min(high, height_at(cells, x + radius * FACE_X[point], y + radius * FACE_Y[point], low))
        if top > low + STRAIGHT_MM:
            met += 1
            height += top - low
    face = math.pi * radius * radius / END_FACE_POINTS
    return face * met, face * height


@kernel
def _with_room(cells: Cells, k: int, start: float) -> Cells:
    """The cells, with a pool that has room for what sweep `k` may enter from the position `start` on."""
    first_i, last_i, first_j, last_j = span(cells, k, start)
    needed = cells.used[ENTRIES] + max(last_i - first_i, 0) * max(last_j - first_j, 0)
    if needed <= len(cells.link):
        return cells
    link, owner = np.empty(2 * needed, np.int32), np.empty(2 * needed, np.int32)
    link[: len(cells.link)], owner[: len(cells.link)] = cells.link, cells.owner
    return Cells(
        cells.x, cells.y, cells.side, cells.low_x, cells.low_y, cells.low_z, cells.high_x, cells.high_y, cells.high_z,
        cells.floor, cells.head, link, owner, cells.sweeps, cells.used,
    )  # fmt: skip


@kernel
def _new_sweep(cells: Cells, x: float, y: float, z: float, ux: float, uy: float, slope: float, radius: float) -> int:
    """Begin a sweep at a point, with no length yet."""
    k = int(cells.used[SWEEPS])
    cells.used[SWEEPS] += 1
    sweep = cells.sweeps[k]
    sweep[X], sweep[Y], sweep[Z], sweep[UX], sweep[UY], sweep[LENGTH], sweep[SLOPE], sweep[RADIUS] = (
        x,
        y,
        z,
        ux,
        uy,
        0.0,
        slope,
        radius,
    )
    return k


@kernel
def _goes_on(cells: Cells, k: int, end: Floats) -> bool:
    """True if the segment to `end` continues sweep `k` on the same straight line."""
    sweep = cells.sweeps[k]
    dx, dy = end[0] - sweep[X], end[1] - sweep[Y]
    along = dx * sweep[UX] + dy * sweep[UY]
    level = abs(sweep[Z] + sweep[SLOPE] * along - end[2])
    return bool(along > sweep[LENGTH] and abs(dx * sweep[UY] - dy * sweep[UX]) < STRAIGHT_MM and level < STRAIGHT_MM)


@kernel
def _upright(cells: Cells, start: Floats, end: Floats, radius: float, rows: Floats) -> Cells:
    """A move along the axis of the tool: going down, the end face cuts; going up, nothing does."""
    if end[2] >= start[2] or end[2] >= cells.high_z:
        return cells
    k = _new_sweep(cells, start[0], start[1], start[2], 1.0, 0.0, 0.0, radius)
    for row in range(len(rows)):
        high = start[2] + (end[2] - start[2]) * row / len(rows)
        low = start[2] + (end[2] - start[2]) * (row + 1) / len(rows)
        if low >= cells.high_z:
            continue
        rows[row, END_FACE], rows[row, AXIAL_VOLUME] = _end_face(cells, start[0], start[1], radius, high, low)
        cells.sweeps[k, Z] = low
        cells = _with_room(cells, k, 0.0)
        remove(cells, k, 0.0)
    return cells


@kernel
def _sideways(cells: Cells, start: Floats, end: Floats, radius: float, rows: Floats, k: int) -> tuple[Cells, int]:
    """A move with a heading, level or ramping, that goes on with sweep `k` if it is straight ahead. Returns its sweep."""
    dx, dy, dz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    length = math.hypot(dx, dy)
    ux, uy = dx / length, dy / length
    if k != NONE and not _goes_on(cells, k, end):
        k = NONE
    for row in range(len(rows)):
        a, b = row / len(rows), (row + 1) / len(rows)
        middle = (a + b) / 2.0
        high, low = start[2] + dz * a, start[2] + dz * b
        if min(high, low) >= cells.high_z:
            k = NONE
            continue
        x, y = start[0] + dx * middle, start[1] + dy * middle
        if dz < 0.0:
            rows[row, END_FACE], rows[row, AXIAL_VOLUME] = _end_face(cells, x, y, radius, high, low)
        met = contact(cells, x, y, ux, uy, radius, start[2] + dz * middle)
        rows[row, DEPTH], rows[row, ENTRY], rows[row, EXIT] = met.depth_mm, met.entry_rad, met.exit_rad
        rows[row, SECTION], rows[row, DEEPEST] = met.section_mm2, met.deepest_mm
        rows[row, ARCS], rows[row, UNIFORM] = met.arcs, met.uniform
        if k == NONE:
            slope = dz / length
            k = _new_sweep(cells, start[0] + dx * a, start[1] + dy * a, high, ux, uy, slope, radius)
        from_mm = cells.sweeps[k, LENGTH]
        cells.sweeps[k, LENGTH] += length * (b - a)
        cells = _with_room(cells, k, from_mm)
        remove(cells, k, from_mm)
    return cells, k


@kernel
def travel(cells: Cells, points: Floats, first_row: NDArray[np.int64], radius: float, rows: Floats) -> tuple[Cells, bool]:
    """Take the tool along the points (n, 3) and fill `rows`; segment i owns the rows first_row[i] to first_row[i + 1].

    Where the path begins, the tool is taken to have cut already. False if the pool of entries passed its limit.
    `cells.sweeps` must have room for n more sweeps.
    """
    k = NONE
    if points[0, 2] < cells.high_z:
        start = _new_sweep(cells, points[0, 0], points[0, 1], points[0, 2], 1.0, 0.0, 0.0, radius)
        cells = _with_room(cells, start, 0.0)
        remove(cells, start, 0.0)
    for i in range(len(points) - 1):
        start_mm, end_mm = points[i], points[i + 1]
        mine = rows[first_row[i] : first_row[i + 1]]
        sideways = math.hypot(end_mm[0] - start_mm[0], end_mm[1] - start_mm[1])
        if sideways <= UPRIGHT * abs(end_mm[2] - start_mm[2]) or sideways < STRAIGHT_MM:
            cells = _upright(cells, start_mm, end_mm, radius, mine)
            k = NONE
        else:
            cells, k = _sideways(cells, start_mm, end_mm, radius, mine, k)
        if cells.used[ENTRIES] > ENTRIES_MAX:
            return cells, False
    return cells, True
