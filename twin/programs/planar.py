"""Lines and arcs in a plane: tangents, parallels, crossings. What corners and cutter compensation are made of."""

import math
from typing import Final, NamedTuple

from twin.programs.arcs import Point

NEAR_MM: Final = 1e-6


class Piece(NamedTuple):
    """A line (`centre` None) or an arc about `centre`, `sweep_rad` + counter-clockwise. Start and end in mm."""

    start: Point
    end: Point
    centre: Point | None = None
    sweep_rad: float = 0.0

    @property
    def radius(self) -> float:
        assert self.centre is not None
        return math.hypot(self.start[0] - self.centre[0], self.start[1] - self.centre[1])


def tangent(piece: Piece, at: Point) -> Point:
    """Unit vector of the direction of travel at a point of the piece."""
    if piece.centre is None:
        along = (piece.end[0] - piece.start[0], piece.end[1] - piece.start[1])
    else:
        turn = 1.0 if piece.sweep_rad > 0 else -1.0
        along = (-turn * (at[1] - piece.centre[1]), turn * (at[0] - piece.centre[0]))
    size = math.hypot(*along)
    return (along[0] / size, along[1] / size)


def left_of(direction: Point, distance: float, at: Point) -> Point:
    """The point that far to the left of `at` (negative: to the right)."""
    return (at[0] - direction[1] * distance, at[1] + direction[0] * distance)


def parallel(piece: Piece, distance: float) -> Piece | None:
    """The piece moved to the left by `distance`; None where an arc would lose its radius.

    >>> parallel(Piece((1.0, 0.0), (0.0, 1.0), (0.0, 0.0), math.pi / 2), 0.25).radius
    0.75
    """
    if piece.centre is not None:
        towards_centre = distance if piece.sweep_rad > 0 else -distance
        if towards_centre >= piece.radius - NEAR_MM:
            return None
    start = left_of(tangent(piece, piece.start), distance, piece.start)
    end = left_of(tangent(piece, piece.end), distance, piece.end)
    return piece._replace(start=start, end=end)


def along(piece: Piece, point: Point, at_end: bool = False) -> float:
    """Return the distance of a point of the curve along the piece, mm; negative just before the start.

    at_end: where start and end of a circle are one point, it is meant as the end
    """
    if piece.centre is None:
        direction = tangent(piece, piece.start)
        return (point[0] - piece.start[0]) * direction[0] + (point[1] - piece.start[1]) * direction[1]
    radius, whole = piece.radius, abs(piece.sweep_rad)
    first = math.atan2(piece.start[1] - piece.centre[1], piece.start[0] - piece.centre[0])
    here = math.atan2(point[1] - piece.centre[1], point[0] - piece.centre[0])
    turned = (here - first if piece.sweep_rad > 0 else first - here) % math.tau
    near = NEAR_MM / radius
    if at_end and turned < near and turned + math.tau <= whole + near:
        turned += math.tau
    # What lies in the gap of the circle belongs to the nearer end.
    elif turned > whole + max(math.tau - whole, 0.0) / 2.0 or (not at_end and turned > math.tau - near):
        turned -= math.tau
    return turned * radius


def extent(piece: Piece) -> float:
    """Length of the piece, mm."""
    if piece.centre is None:
        return math.dist(piece.start, piece.end)
    return abs(piece.sweep_rad) * piece.radius


def crossings(first: Piece, second: Piece) -> list[Point]:
    """Return the points where the whole lines or circles of two pieces meet: none, one or two."""
    if first.centre is None and second.centre is None:
        return line_with_line(first, second)
    if first.centre is None:
        return line_with_circle(first, second)
    if second.centre is None:
        return line_with_circle(second, first)
    return circle_with_circle(first, second)


def line_with_line(first: Piece, second: Piece) -> list[Point]:
    a, b = tangent(first, first.start), tangent(second, second.start)
    cross = a[0] * b[1] - a[1] * b[0]
    if abs(cross) < 1e-12:
        return []
    gap = (second.start[0] - first.start[0], second.start[1] - first.start[1])
    reach = (gap[0] * b[1] - gap[1] * b[0]) / cross
    return [(first.start[0] + reach * a[0], first.start[1] + reach * a[1])]


def line_with_circle(line: Piece, arc: Piece) -> list[Point]:
    assert arc.centre is not None
    direction = tangent(line, line.start)
    to_centre = (arc.centre[0] - line.start[0], arc.centre[1] - line.start[1])
    foot = to_centre[0] * direction[0] + to_centre[1] * direction[1]
    away = to_centre[0] * direction[1] - to_centre[1] * direction[0]
    half = half_chord(arc.radius, away)
    return [(line.start[0] + reach * direction[0], line.start[1] + reach * direction[1]) for reach in spread(foot, half)]


def circle_with_circle(first: Piece, second: Piece) -> list[Point]:
    assert first.centre is not None and second.centre is not None
    gap = math.dist(first.centre, second.centre)
    if gap < 1e-12:
        return []
    axis = ((second.centre[0] - first.centre[0]) / gap, (second.centre[1] - first.centre[1]) / gap)
    foot = (gap * gap + first.radius**2 - second.radius**2) / (2.0 * gap)
    half = half_chord(first.radius, foot)
    base = (first.centre[0] + axis[0] * foot, first.centre[1] + axis[1] * foot)
    return [left_of(axis, side, base) for side in spread(0.0, half)]


def half_chord(radius: float, away: float) -> float | None:
    """Half the chord that a line cuts off at `away` from the centre; 0 for a touch within a nanometre's reach, None beyond."""
    square = (radius - abs(away)) * (radius + abs(away))
    if square < 0.0:
        return 0.0 if abs(away) - radius < NEAR_MM else None
    return math.sqrt(square)


def spread(middle: float, half: float | None) -> list[float]:
    if half is None:
        return []
    return [middle] if half == 0.0 else [middle - half, middle + half]


def trimmed(piece: Piece, start: Point | None = None, end: Point | None = None) -> Piece:
    """The piece between two points of its curve; None = where it starts or ends now."""
    first, last = start or piece.start, end or piece.end
    if piece.centre is None:
        return piece._replace(start=first, end=last)
    direction = 1.0 if piece.sweep_rad > 0 else -1.0
    length = extent(piece) if end is None else along(piece, last, at_end=True)
    begin = 0.0 if start is None else along(piece, first)
    if end is not None and abs(piece.sweep_rad) > math.tau:
        # The place on a circle does not tell the turn; an end is cut off by less than half of one.
        length += math.tau * piece.radius * round((extent(piece) - length) / (math.tau * piece.radius))
    return piece._replace(start=first, end=last, sweep_rad=direction * (length - begin) / piece.radius)


def shared(first: Piece, second: Piece, reach_mm: float, begin_mm: float = 0.0) -> Point | None:
    """Return the point where one piece, shortened at its end, meets the other, shortened at its start; None where they do not.

    begin_mm: what of the first is gone already, at its start
    reach_mm: by how much a piece may be passed, for the rounding of the program's figures
    """
    found, best = None, math.inf
    for point in crossings(first, second):
        leaves, enters = along(first, point, at_end=True), along(second, point)
        lost = extent(first) - leaves + enters
        inside = begin_mm - reach_mm <= leaves <= extent(first) + reach_mm
        inside = inside and -reach_mm <= enters <= extent(second) + reach_mm
        if inside and abs(lost) < best:
            found, best = point, abs(lost)
    return found


def turn_between(first: Piece, second: Piece) -> float:
    """The angle by which the direction changes at the corner, rad, + to the left."""
    a, b = tangent(first, first.end), tangent(second, second.start)
    return math.atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1])
