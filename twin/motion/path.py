"""The path of a program: its moves as arrays, one row a segment, with what happens between them.

A line of length L from p₀ to p₁ is p(s) = p₀ + (p₁ − p₀) s / L. An arc of sweep θ about a centre c in a plane with first and
second axis (u, v) is, with the fraction f = s / L, p_u = c_u + r(f) cos(φ₀ + θ f), p_v = c_v + r(f) sin(φ₀ + θ f); the axes
outside the plane move with f (helix). r(f) goes linearly from the radius of the start to that of the end, which differ by the
rounding of the program, so that the end is met exactly; L = √((r θ)² + h²) with the mean radius r and the helix height h.
The planes are those of `twin.programs.planes`. A sweep is positive counter-clockwise seen from the positive normal of its plane.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from twin.motion.geometry import Segments, curvature_at, points_at, tangents_at
from twin.programs import canonical
from twin.programs.planes import PLANES

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
PLANE_AXES = np.array([PLANES[code][:2] for code in (17, 18, 19)], dtype=np.int64)
"""First and second axis, by the number of the plane less 17."""
LINEAR_AXES = 3
UP = np.array([0.0, 0.0, 1.0])
SHORTEST_MM = 1e-9
"""A move shorter than this does not move: the rounding of a block, not a segment."""


class Kind(IntEnum):
    """The kind of motion along a segment."""

    RAPID = 0
    LINE = 1
    ARC = 2


class EventKind(IntEnum):
    """The kind of an event between segments."""

    DWELL = 0
    TOOL_CHANGE = 1
    SPINDLE = 2
    PROGRAM_STOP = 3
    PROGRAM_END = 4
    COOLANT = 5
    ORIENT = 6


@dataclass(frozen=True, slots=True)
class Event:
    """Something that is no motion, before segment `segment` (= their number: after the last one).

    value: seconds of a dwell, number of a tool, signed rev/min of the spindle, 1 or 0 of coolant and optional stop
    """

    segment: int
    kind: EventKind
    value: float
    line: int


@dataclass(frozen=True, slots=True)
class Path:
    """Segments (rows of arrays, all of one length n) and the events between them. Lengths in mm, feeds in mm/min.

    start_mm, end_mm: (n, axes); centre_mm: (n, axes), of use for arcs only
    plane_axes: (n, 2) first and second axis of the plane; sweep_rad: 0 for what is no arc
    exact_stop: (n,) the segment ends at rest (G61, G9)
    tolerance_mm: (n,) the contour tolerance that the program states there; NaN = none, the machine's own corner rule holds
    jerk_limited: (n,) False where the program has switched the jerk limit off (BRISK)
    tool_mm: (n, 2) length of the tool in z, as the control counts it, at the start and at the end of each segment; they differ
        where the segment takes up another one
    line: (n,) source line
    """

    axes: tuple[str, ...]
    line: Ints
    kind: Ints
    start_mm: Floats
    end_mm: Floats
    centre_mm: Floats
    plane_axes: Ints
    sweep_rad: Floats
    length_mm: Floats
    feed_mm_min: Floats
    exact_stop: NDArray[np.bool_]
    tolerance_mm: Floats
    jerk_limited: NDArray[np.bool_]
    tool_mm: Floats
    events: tuple[Event, ...]

    def __len__(self) -> int:
        return len(self.line)

    def segments(self) -> Segments:
        """Return the segments as the kernels take them."""
        ends = self.start_mm, self.end_mm, self.centre_mm
        return Segments(self.line, self.kind, *ends, self.plane_axes, self.sweep_rad, self.length_mm)

    def at(self, segment: Ints, s_mm: Floats) -> Floats:
        """Points (n, axes) at the distances `s_mm` (n,) from the start of the segments `segment` (n,)."""
        return points_at(self.segments(), segment, s_mm)

    def tip_at(self, segment: Ints, s_mm: Floats) -> Floats:
        """x, y, z of the tool's tip (n, 3) at these distances: the axes stand higher by the length of the tool."""
        tip = self.at(segment, s_mm)[:, :LINEAR_AXES].copy()
        start, end = self.tool_mm[segment, 0], self.tool_mm[segment, 1]
        tip[:, 2] -= start + (end - start) * s_mm / np.where(self.length_mm[segment] > 0.0, self.length_mm[segment], 1.0)
        return tip

    def tip_ends_mm(self, segments: Ints) -> tuple[Floats, Floats]:
        """x, y, z of the tip at the start and at the end of these segments, (n, 3) each."""
        start, end = self.start_mm[segments, :LINEAR_AXES], self.end_mm[segments, :LINEAR_AXES]
        return start - self.tool_mm[segments, :1] * UP, end - self.tool_mm[segments, 1:] * UP

    def tangents(self, segment: Ints, s_mm: Floats) -> Floats:
        """dp/ds (n, axes): of length 1 in the axes that the feed counts."""
        return tangents_at(self.segments(), segment, s_mm)

    def curvature_per_mm(self) -> Floats:
        """Curvature (n,) of each segment, 1/mm: r θ² / L² of an arc (that of the helix), 0 of a line."""
        return curvature_at(self.segments())

    def commanded_rpm(self) -> Floats:
        """The speed of the spindle that is commanded on each segment (n,), rev/min; negative = M4."""
        rpm = np.zeros(len(self))
        for event in self.events:
            if event.kind in (EventKind.SPINDLE, EventKind.ORIENT):
                rpm[event.segment :] = event.value if event.kind == EventKind.SPINDLE else 0.0
        return rpm


@dataclass
class _Builder:
    """The rows as they come."""

    position: tuple[float, ...]
    tool_change_mm: tuple[float | None, ...]

    def __post_init__(self) -> None:
        self.rows: list[tuple[float, ...]] = []
        self.points: list[tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]] = []
        self.events: list[Event] = []
        self.exact_stop, self.jerk_limited, self.tolerance_mm = False, True, np.nan
        self.tool_mm = self.tool_before_mm = 0.0

    def event(self, kind: EventKind, value: float, line: int) -> None:
        self.events.append(Event(len(self.rows), kind, float(value), line))

    def segment(
        self,
        line: int,
        kind: Kind,
        end: tuple[float, ...],
        feed: float,
        centre: tuple[float, ...] | None = None,
        plane: int = 17,
        sweep: float = 0.0,
    ) -> None:
        start, self.position = self.position, end
        tool_before, self.tool_before_mm = self.tool_before_mm, self.tool_mm
        length = _length(start, end, centre, plane, sweep)
        if length < SHORTEST_MM:
            return
        modes = (self.exact_stop, self.tolerance_mm, self.jerk_limited)
        self.rows.append((line, kind, plane, sweep, length, feed, *modes, tool_before, self.tool_mm))
        self.points.append((start, end, centre or start))


def _length(
    start: tuple[float, ...], end: tuple[float, ...], centre: tuple[float, ...] | None, plane: int, sweep: float
) -> float:
    """Return the length that the feed counts: that of the linear axes, or of the rotary ones where nothing else moves."""
    moved = [b - a for a, b in zip(start, end, strict=True)]
    if centre is not None:
        u, v, normal = PLANES[plane]
        radius = (_radius(start, centre, u, v) + _radius(end, centre, u, v)) / 2.0
        return float(np.hypot(radius * sweep, moved[normal]))
    linear = float(np.sqrt(sum(d * d for d in moved[:LINEAR_AXES])))
    return linear if linear >= SHORTEST_MM else float(np.sqrt(sum(d * d for d in moved[LINEAR_AXES:])))


def _radius(point: tuple[float, ...], centre: tuple[float, ...], u: int, v: int) -> float:
    return float(np.hypot(point[u] - centre[u], point[v] - centre[v]))


def path_from_moves(
    moves: Sequence[canonical.Move],
    start_mm: tuple[float, ...] | None = None,
    axes: tuple[str, ...] = ("x", "y", "z"),
    tool_change_mm: tuple[float | None, ...] = (),
) -> Path:
    """The path of `moves`, from `start_mm` (default: the origin). Moves that go nowhere leave no segment.

    tool_change_mm: where a tool change takes the axes in rapid first; None = that axis stays, () = all stay.

    >>> path = path_from_moves([canonical.Linear(0, (3.0, 4.0, 0.0), 600.0, None)])
    >>> float(path.length_mm[0]), path.at(np.array([0]), np.array([2.5])).tolist()
    (5.0, [[1.5, 2.0, 0.0]])
    """
    builder = _Builder(start_mm if start_mm is not None else (0.0,) * len(axes), tool_change_mm)
    for move in moves:
        _add(builder, move)
    rows = np.array(builder.rows, dtype=np.float64).reshape(-1, 11)
    points = np.array(builder.points, dtype=np.float64).reshape(-1, 3, len(axes))
    return Path(
        axes=axes,
        line=rows[:, 0].astype(np.int64),
        kind=rows[:, 1].astype(np.int64),
        start_mm=np.ascontiguousarray(points[:, 0]),
        end_mm=np.ascontiguousarray(points[:, 1]),
        centre_mm=np.ascontiguousarray(points[:, 2]),
        plane_axes=PLANE_AXES[rows[:, 2].astype(np.int64) - 17],
        sweep_rad=rows[:, 3].copy(),
        length_mm=rows[:, 4].copy(),
        feed_mm_min=rows[:, 5].copy(),
        exact_stop=rows[:, 6].astype(np.bool_),
        tolerance_mm=rows[:, 7].copy(),
        jerk_limited=rows[:, 8].astype(np.bool_),
        tool_mm=rows[:, 9:].copy(),
        events=tuple(builder.events),
    )


def _add(builder: _Builder, move: canonical.Move) -> None:
    match move:
        case canonical.Rapid():
            builder.segment(move.line, Kind.RAPID, move.end_mm, np.inf)
        case canonical.Linear():
            builder.segment(move.line, Kind.LINE, move.end_mm, move.feed_mm_min)
        case canonical.Arc():
            builder.segment(move.line, Kind.ARC, move.end_mm, move.feed_mm_min, move.centre_mm, move.plane, move.sweep_rad)
        case canonical.Dwell():
            builder.event(EventKind.DWELL, move.seconds, move.line)
        case canonical.ToolChange():
            if builder.tool_change_mm:
                there = zip(builder.tool_change_mm, builder.position, strict=True)
                builder.segment(move.line, Kind.RAPID, tuple(at if to is None else to for to, at in there), np.inf)
            builder.event(EventKind.TOOL_CHANGE, move.tool, move.line)
        case canonical.Spindle():
            builder.event(EventKind.SPINDLE, move.rpm * move.direction, move.line)
        case canonical.SpindleOrient():
            builder.event(EventKind.ORIENT, 0.0, move.line)
        case canonical.Coolant():
            builder.event(EventKind.COOLANT, move.on, move.line)
        case canonical.ProgramStop():
            builder.event(EventKind.PROGRAM_STOP, move.optional, move.line)
        case canonical.ProgramEnd():
            builder.event(EventKind.PROGRAM_END, 0.0, move.line)
        case canonical.ToolLength():
            builder.tool_mm = move.length_mm
        case canonical.ExactStop():
            builder.exact_stop = move.on
        case canonical.LookAhead():
            pass  # The planner looks ahead over the whole program in either state.
        case canonical.Tolerance():
            builder.tolerance_mm = np.nan if move.contour_mm is None else move.contour_mm
        case canonical.JerkLimit():
            builder.jerk_limited = move.limited
        case canonical.FeedForward():
            pass  # The feed-forward of the simulated servo is the machine's, for the whole run.
