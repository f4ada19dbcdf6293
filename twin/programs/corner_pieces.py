"""The piece between two pieces that meet at a corner: a chamfer or a rounding.

A rounding is an arc touching both; its centre is where their parallels at its radius on the inner side cross. A chamfer is the
straight line between the two points at its size from the corner. `joined` puts such a piece between two motions.
"""

import math
from typing import Final, NamedTuple

from twin.programs.arcs import Point
from twin.programs.canonical import Motion, Position
from twin.programs.pieces import placed, rebuilt, rounded, straight
from twin.programs.planar import Piece, along, crossings, extent, left_of, parallel, shared, tangent, trimmed

REACH_MM: Final = 1e-6
STRAIGHT_RAD: Final = 1e-6
"""Below this change of direction there is no corner."""


class Joined(NamedTuple):
    """A motion up to its corner, the corner, and what is left of the motion behind it; where the corner begins and ends."""

    before: Motion
    corner: Motion
    behind: Motion
    begin_mm: Position
    end_mm: Position


def joined(before: Motion, start_mm: Position, first: Piece, behind: Motion, second: Piece, between: Piece, plane: int) -> Joined:
    """Return two motions of a plane with a piece between them.

    start_mm: where the first motion begins; first, second: the pieces that they are in the plane
    """
    begin, end = placed(before.end_mm, between.start, plane), placed(before.end_mm, between.end, plane)
    return Joined(
        rebuilt(before, start_mm, trimmed(first, end=between.start), plane),
        straight(before, end) if between.centre is None else rounded(before, begin, between, plane),
        rebuilt(behind, end, trimmed(second, start=between.end), plane),
        begin,
        end,
    )


def chamfer(first: Piece, second: Piece, size_mm: float) -> Piece | None:
    """The straight line between the points at that distance from the corner; None where it does not fit."""
    corner = first.end
    begin_at = point_at(first, corner, size_mm, at_end=True)
    end_at = point_at(second, corner, size_mm, at_end=False)
    return None if begin_at is None or end_at is None else Piece(begin_at, end_at)


def point_at(side: Piece, corner: Point, size: float, at_end: bool) -> Point | None:
    """The point of a side at that distance from the corner, at its end or its start; the nearest along the side."""
    ring = Piece((corner[0] + size, corner[1]), (corner[0] + size, corner[1]), corner, math.tau)
    found, best = None, math.inf
    for point in crossings(side, ring):
        reach = along(side, point, at_end)
        away = extent(side) - reach if at_end else reach
        if -REACH_MM <= reach <= extent(side) + REACH_MM and away < best:
            found, best = point, away
    return found


def rounding(first: Piece, second: Piece, radius_mm: float, turn: float) -> Piece | None:
    """The arc that touches both; None where it does not fit. turn: of the direction at the corner, + to the left."""
    inner = math.copysign(radius_mm, turn)
    one, other = parallel(first, inner), parallel(second, inner)
    if one is None or other is None:
        return None
    centre = shared(one, other, REACH_MM)
    if centre is None:
        return None
    start = left_of(tangent(first, touching(first, centre)), -inner, centre)
    end = left_of(tangent(second, touching(second, centre)), -inner, centre)
    begin_angle = math.atan2(start[1] - centre[1], start[0] - centre[0])
    end_angle = math.atan2(end[1] - centre[1], end[0] - centre[0])
    sweep = (end_angle - begin_angle) % math.tau if turn > 0 else -((begin_angle - end_angle) % math.tau)
    return Piece(start, end, centre, sweep)


def touching(side: Piece, centre: Point) -> Point:
    """A point of the side's curve in whose direction of travel the rounding touches it: seen from an arc's centre, this point."""
    return side.start if side.centre is None else centre
