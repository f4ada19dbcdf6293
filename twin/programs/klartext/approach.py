"""The ways on and off a contour that APPR and DEP draw, on the path of the tool's centre.

P_S start, P_H auxiliary point, P_A first and P_E last point of the contour, P_N end. LT: straight, along the contour. LN:
straight and square to it, on the tool's side. CT: an arc that touches it. LCT: the same, and a straight line that touches the
arc. An arc of RL turns counter-clockwise, of RR clockwise; a negative R turns it over (User's Manual TNC7 81762x-16, "Approach
function APPR CT"). The way to P_H is in the plane first, then along the tool's axis (User's Manual TNC 640 34059x-02, page 199).
"""

import math

from twin.programs.arcs import Point
from twin.programs.canonical import Arc, Linear, Motion, Move, Position, Rapid
from twin.programs.klartext.state import Approach
from twin.programs.pieces import in_plane, placed
from twin.programs.planar import left_of
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError

SAME_MM = 1e-9


def turned(point: Point, centre: Point, angle_rad: float) -> Point:
    """The point, turned about a centre."""
    a, b = point[0] - centre[0], point[1] - centre[1]
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    return (centre[0] + cosine * a - sine * b, centre[1] + sine * a + cosine * b)


def touching(centre: Point, radius: float, sense: int, outer: Point, arrives: bool) -> Point | None:
    """The point of a circle where a line from (`arrives`) or to a point outside touches it in the sense of rotation.

    >>> [round(x, 3) for x in touching((-10.0, 5.0), 5.0, 1, (-10.0, -10.0), True)]
    [-5.286, 3.333]
    """
    away = math.dist(centre, outer)
    if away < radius:
        return None
    angle = math.acos(min(radius / away, 1.0)) * sense * (1 if arrives else -1)
    angle += math.atan2(outer[1] - centre[1], outer[0] - centre[0])
    return (centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle))


def swept(centre: Point, start: Point, end: Point, sense: int) -> float:
    """The angle from start to end in that sense; 0 where they are one point."""
    first = math.atan2(start[1] - centre[1], start[0] - centre[0])
    last = math.atan2(end[1] - centre[1], end[0] - centre[0])
    turn = ((last - first) * sense) % math.tau
    return 0.0 if min(turn, math.tau - turn) < 1e-9 else sense * turn


def auxiliary(way: Approach, start: Point, end: Point, direction: Point) -> tuple[Point, Point | None, float]:
    """P_H, and the centre and sweep of the arc from there; without a centre it is a line."""
    if way.kind == "LT":
        return (end[0] - way.length_mm * direction[0], end[1] - way.length_mm * direction[1]), None, 0.0
    if way.kind == "LN":
        return left_of(direction, way.side * way.length_mm, end), None, 0.0
    sense = way.side if way.length_mm > 0.0 else -way.side
    radius = abs(way.length_mm)
    centre = left_of(direction, sense * radius, end)
    if way.kind == "CT":
        return turned(end, centre, -sense * way.angle_rad), centre, sense * way.angle_rad
    found = touching(centre, radius, sense, start, arrives=True)
    if found is None:
        raise RefusedError(
            "APPR", f"no line from the starting point touches this arc of {radius:g} mm; start further away", place(way)
        )
    return found, centre, swept(centre, found, end, sense)


def place(way: Approach) -> tuple[int, str | None]:
    return (way.first.line, way.first.program)


def draw(out: list[Move], way: Approach, position: Position, end: Point, direction: Point, plane: int) -> Position:
    """Put out the approach; returns where the tool is then.

    end, direction: of the compensated contour at its first point
    """
    helper, centre, sweep = auxiliary(way, in_plane(position, plane), end, direction)
    here = go(out, way.first, position, placed(position, helper, plane))
    if way.depth_mm is not None:
        down = list(here)
        down[PLANES[plane][2]] = way.depth_mm
        here = go(out, way.rest, here, tuple(down))
    if centre is None:
        return go(out, way.rest, here, placed(here, end, plane))
    return along_arc(out, way.rest, here, placed(here, end, plane), centre, plane, sweep)


def go(out: list[Move], like: Motion, here: Position, end: Position) -> Position:
    """A straight motion; none where it has no length."""
    if math.dist(here, end) <= SAME_MM:
        return here
    if isinstance(like, Rapid):
        out.append(like._replace(end_mm=end))
    else:
        out.append(Linear(like.line, end, like.feed_mm_min, like.feed_per_rev_mm, like.program))
    return end


def along_arc(out: list[Move], like: Motion, here: Position, end: Position, centre: Point, plane: int, sweep: float) -> Position:
    if sweep == 0.0:
        return go(out, like, here, end)
    if isinstance(like, Rapid):
        raise RefusedError("FMAX", "cannot go along the arc of APPR or DEP; write a feed", (like.line, like.program))
    full = placed(here[:3], centre, plane)
    middle = (full[0], full[1], full[2])
    out.append(Arc(like.line, end, middle, plane, sweep, like.feed_mm_min, like.feed_per_rev_mm, like.program))
    return end


def depart(out: list[Move], way: Approach, position: Position, direction: Point, goal: Point | None, plane: int) -> Position:
    """Put out the departure from P_E; goal: P_N of LCT. Returns where the tool is then."""
    start = in_plane(position, plane)
    here = position
    if way.kind == "LT":
        last = (start[0] + way.length_mm * direction[0], start[1] + way.length_mm * direction[1])
        here = go(out, way.rest, here, placed(here, last, plane))
    elif way.kind == "LN":
        here = go(out, way.rest, here, placed(here, left_of(direction, way.side * way.length_mm, start), plane))
    else:
        sense = way.side if way.length_mm > 0.0 else -way.side
        radius = abs(way.length_mm)
        centre = left_of(direction, sense * radius, start)
        if goal is None:
            off, sweep = turned(start, centre, sense * way.angle_rad), sense * way.angle_rad
        else:
            found = touching(centre, radius, sense, goal, arrives=False)
            if found is None:
                raise RefusedError(
                    "DEP", f"no line to the end point touches this arc of {radius:g} mm; end further away", place(way)
                )
            off, sweep = found, swept(centre, start, found, sense)
        here = along_arc(out, way.rest, here, placed(here, off, plane), centre, plane, sweep)
        if goal is not None:
            here = go(out, way.rest, here, placed(here, goal, plane))
    if way.depth_mm is not None:
        up = list(here)
        up[PLANES[plane][2]] = way.depth_mm
        here = go(out, way.rest, here, tuple(up))
    return here
