"""Cutting: a workpiece and a path in, what is left and the engagement along the path out."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.engagement.engaged import Collision, Engagement
from twin.engagement.sweep import Floats
from twin.engagement.travel import (
    ARCS,
    AXIAL_VOLUME,
    COLUMNS,
    DEEPEST,
    DEPTH,
    END_FACE,
    ENTRIES_MAX,
    ENTRY,
    EXIT,
    SECTION,
    UNIFORM,
    travel,
)
from twin.engagement.workpiece import Workpiece
from twin.errors import EngagementError

ROWS_MAX = 20_000_000


def cut(
    workpiece: Workpiece,
    points_mm: ArrayLike,
    tool_diameter_mm: float,
    resolution_mm: float = 0.1,
    cutting: ArrayLike | None = None,
) -> tuple[Workpiece, Engagement]:
    """Return the workpiece after the cut, and the engagement along the path. The workpiece that was given stays as it was.

    points_mm: (n, 3) polyline of the tool tip in machine coordinates; tool_diameter_mm: of a cylindrical flat end mill
    resolution_mm: largest distance of the rows along the path
    cutting: (n - 1,) True where a segment is a feed move; None = all are. What a rapid meets is a collision.

    Where the path begins, the tool is taken to have cut already. Raises EngagementError.

    A slot 2 mm deep with a 6 mm tool is 0 to π all along:

    >>> from twin.machine import Stock
    >>> stock = Stock(min_mm=(0, 0, -10), max_mm=(40, 30, 0))
    >>> _left, slot = cut(Workpiece.of(stock, cell_mm=0.4), [(10, 15, -2), (30, 15, -2)], 6.0, resolution_mm=5.0)
    >>> slot.axial_depth_mm.tolist(), slot.entry_angle_rad.tolist(), (slot.exit_angle_rad / np.pi).tolist()
    ([2.0, 2.0, 2.0, 2.0], [0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0])
    """
    points, feed = _checked(points_mm, tool_diameter_mm, resolution_mm, cutting)
    lengths = np.sqrt(np.sum(np.diff(points, axis=0) ** 2, axis=1))
    counts = np.maximum(1, np.ceil(lengths / resolution_mm - 1e-9)).astype(np.int64)
    first_row = np.concatenate(([0], np.cumsum(counts)))
    if first_row[-1] > ROWS_MAX:
        raise EngagementError(
            f"{lengths.sum():.0f} mm of path in steps of {resolution_mm:g} mm are {first_row[-1]} rows, more than {ROWS_MAX}; "
            f"take a coarser resolution_mm"
        )
    rows = np.zeros((int(first_row[-1]), COLUMNS))
    radius = tool_diameter_mm / 2.0
    cells, complete = travel(workpiece.made_ready(points, radius), points, first_row, radius, rows)
    if not complete:
        raise EngagementError(
            f"the walls of the workpiece are made of more than {ENTRIES_MAX} pieces; sample the arcs with longer chords"
        )
    return Workpiece(cells, workpiece.cells_max), _engagement(points, lengths, first_row, rows, feed)


def _check_size(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise EngagementError(f"{name} {value} is no size; it is in mm and above 0")


def _checked(
    points_mm: ArrayLike, tool_diameter_mm: float, resolution_mm: float, cutting: ArrayLike | None
) -> tuple[Floats, NDArray[np.bool_]]:
    """Points and feed flags as arrays. Raises EngagementError naming what is wrong with them."""
    _check_size("tool_diameter_mm", tool_diameter_mm)
    _check_size("resolution_mm", resolution_mm)
    points = np.ascontiguousarray(points_mm, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2:
        raise EngagementError(f"points_mm has the shape {points.shape}; a path is (n, 3) with two points or more")
    if not np.isfinite(points).all():
        first = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise EngagementError(f"points_mm[{first}] is {points[first].tolist()}; every coordinate is a finite number of mm")
    feed = np.ones(len(points) - 1, bool) if cutting is None else np.asarray(cutting, dtype=bool)
    if feed.shape != (len(points) - 1,):
        raise EngagementError(f"cutting has the shape {feed.shape}; {len(points)} points have {len(points) - 1} segments")
    return points, feed


def _engagement(
    points: Floats, lengths: Floats, first_row: NDArray[np.int64], rows: Floats, feed: NDArray[np.bool_]
) -> Engagement:
    """The rows with their places."""
    counts = np.diff(first_row)
    segment = np.repeat(np.arange(len(counts)), counts)
    rank = np.arange(len(rows)) - first_row[segment]
    length = lengths[segment] / counts[segment]
    start = np.concatenate(([0.0], np.cumsum(lengths)))[segment] + rank * length
    fraction = ((rank + 0.5) / counts[segment])[:, None]
    moves = np.diff(points, axis=0)
    position = points[segment] + fraction * moves[segment]
    sideways = (np.hypot(moves[:, 0], moves[:, 1]) / counts)[segment]
    meets = (rows[:, ARCS] > 0) | (rows[:, AXIAL_VOLUME] > 0.0)
    hit = np.flatnonzero(meets & ~feed[segment])
    firsts = hit[np.unique(segment[hit], return_index=True)[1]]
    return Engagement(
        first_row=first_row,
        segment=segment,
        start_mm=start,
        length_mm=length,
        position_mm=position,
        axial_depth_mm=rows[:, DEPTH].copy(),
        entry_angle_rad=rows[:, ENTRY].copy(),
        exit_angle_rad=rows[:, EXIT].copy(),
        section_mm2=rows[:, SECTION].copy(),
        deepest_mm=rows[:, DEEPEST].copy(),
        arcs=rows[:, ARCS].astype(np.int64),
        exact=rows[:, UNIFORM] > 0.0,
        end_face_mm2=rows[:, END_FACE].copy(),
        removed_mm3=rows[:, SECTION] * sideways + rows[:, AXIAL_VOLUME],
        collisions=tuple(
            Collision(int(segment[k]), float(start[k]), (float(position[k, 0]), float(position[k, 1]), float(position[k, 2])))
            for k in firsts
        ),
    )
