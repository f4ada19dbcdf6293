"""Cutter compensation: the path of the tool's centre, beside the programmed one by the tool's radius.

Each motion in the plane is moved to its side (a parallel). Where two meet at an inside corner, both end where their parallels
cross; at an outside corner the tool goes round it (`OutsideCorner`). Where a motion would have to run backwards, the tool would
cut into what it must not touch: an error (the interference check of a control). A section, from where compensation is switched on
to where it is off again, is worked out whole. From one side to the other the tool goes where the two paths cross, else straight
over. Source: operator's manual B-64604EN, "cutter compensation"; checked against rs274 with its arcs and its lead-in.
"""

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

from twin.programs.arcs import Point
from twin.programs.canonical import Arc, Linear, Motion, Move, Position, Rapid
from twin.programs.pieces import piece, placed, rebuilt, rounded, straight
from twin.programs.planar import Piece, along, crossings, extent, left_of, parallel, shared, tangent, trimmed, turn_between
from twin.programs.refusal import RefusedError
from twin.programs.settings import LeadIn, OutsideCorner

REACH_MM: Final = 1e-6
SMOOTH_RAD: Final = 1e-3
"""Below this change of direction two motions are one smooth line: at 10 mm radius the two ends are 10 µm apart along it."""
CROSSING_RAD_MAX: Final = math.radians(100.0) + SMOOTH_RAD
"""Up to this corner the tool goes to where the parallels cross, with `OutsideCorner.CROSSING` (MD20210 of SINUMERIK)."""
NEARLY_SMOOTH_RAD: Final = 0.035
"""Up to this one, an inside corner whose parallels miss each other by the rounding of the program is taken as smooth."""


@dataclass(slots=True)
class CompensatedSection:
    """A stretch put out since compensation was switched on, uncompensated.

    offsets_mm: for each motion in `moves`, by its index, how far to the left the tool's centre goes; None: the tool leaves
    on, off: the words that switch it, as an error names them
    """

    start_mm: Position
    plane: int
    moves: list[Move] = field(default_factory=list)
    offsets_mm: dict[int, float | None] = field(default_factory=dict)
    on: str = "G41"
    off: str = "G40"


@dataclass(slots=True)
class Side:
    """One motion of the section.

    shifted: its parallel, whole; the tool runs on it from `begin` to `end`, `begin_mm` along it
    bridges: what leads from `end` to the next side's `begin`; events: what was put out between this motion and the next
    """

    move: Motion
    programmed: Piece
    offset_mm: float
    shifted: Piece
    leaves: bool
    begin: Point
    end: Point
    begin_mm: float = 0.0
    bridges: list[Piece] = field(default_factory=list)
    events: list[Move] = field(default_factory=list)

    @property
    def place(self) -> tuple[int, str | None]:
        return (self.move.line, self.move.program)


def compensated(section: CompensatedSection, lead_in: LeadIn, outside_corner: OutsideCorner) -> tuple[list[Move], Position]:
    """Return the moves of the tool's centre, and where in the plane they end (out of it: where the section starts).

    Raises RefusedError, with its place, where the tool does not fit.
    """
    out: list[Move] = []
    before: list[Move] = []
    sides = collect(section, before)
    for first, second in pairwise(sides):
        join(first, second, first is sides[0], lead_in, outside_corner)
    position = section.start_mm
    for move in before:
        out.append(move)
        position = getattr(move, "end_mm", position)
    for side in sides:
        position = put_out(out, side, position, section.plane)
    return out, position


def collect(section: CompensatedSection, before: list[Move]) -> list[Side]:
    """The motions in the plane with their parallels; what comes before the first goes into `before`."""
    sides: list[Side] = []
    position = section.start_mm
    for index, move in enumerate(section.moves):
        if not isinstance(move, Rapid | Linear | Arc):
            (sides[-1].events if sides else before).append(move)
            continue
        start, position = position, move.end_mm
        programmed = piece(start, move, section.plane)
        if extent(programmed) < REACH_MM:
            (sides[-1].events if sides else before).append(move)
            continue
        offset = section.offsets_mm[index]
        leaves = offset is None
        if isinstance(move, Arc) and (leaves or not sides):
            text = section.off if leaves else section.on
            raise RefusedError(text, "cutter compensation begins and ends in a straight move", (move.line, move.program))
        shifted = parallel(programmed, offset or 0.0)
        if shifted is None:
            reason = f"the tool, {abs(offset or 0.0):g} mm in radius, does not fit into this arc of {programmed.radius:g} mm"
            raise RefusedError("", reason, (move.line, move.program))
        sides.append(Side(move, programmed, offset or 0.0, shifted, leaves, shifted.start, shifted.end))
    return sides


def join(first: Side, second: Side, leads_in: bool, lead_in: LeadIn, outside_corner: OutsideCorner) -> None:
    """Settle where the tool leaves one motion for the next."""
    if leads_in and lead_in is LeadIn.OWN and extent(first.programmed) <= abs(first.offset_mm):
        raise RefusedError("", "the move that leads in is not longer than the tool's radius", first.place)
    if second.leaves or first.leaves:
        second.begin = first.end
    elif leads_in and lead_in is LeadIn.NEXT:
        first.end = second.begin
    elif first.offset_mm != second.offset_mm:
        change_sides(first, second)
    elif first.offset_mm != 0.0:
        turn = turn_between(first.programmed, second.programmed)
        if abs(turn) < SMOOTH_RAD:
            meet_halfway(first, second)
        elif turn * first.offset_mm > 0.0:
            inside(first, second, turn)
        elif outside_corner is OutsideCorner.CROSSING and abs(turn) <= CROSSING_RAD_MAX and cross(first, second):
            pass
        elif outside_corner is not OutsideCorner.LINE and not isinstance(first.move, Rapid):
            first.bridges.append(Piece(first.end, second.begin, first.programmed.end, turn))
        else:
            outside(first, second, turn)


def cross(first: Side, second: Side) -> bool:
    """Lengthen both sides of an outside corner up to where their curves cross, if they do so near the corner."""
    reach_max = abs(first.offset_mm) * math.tan(CROSSING_RAD_MAX / 2.0) + REACH_MM
    near = [point for point in crossings(first.shifted, second.shifted) if math.dist(point, first.end) <= reach_max]
    if not near:
        return False
    first.end = second.begin = min(near, key=lambda point: math.dist(point, first.programmed.end))
    second.begin_mm = along(second.shifted, second.begin)
    return True


def normal(piece_of: Piece, at: Point, distance: float) -> Point:
    """From a point of the path to the point beside it."""
    return left_of(tangent(piece_of, at), distance, (0.0, 0.0))


def meet_halfway(first: Side, second: Side) -> None:
    middle = ((first.end[0] + second.begin[0]) / 2.0, (first.end[1] + second.begin[1]) / 2.0)
    first.end = second.begin = middle


def inside(first: Side, second: Side, turn: float) -> None:
    """Both end where the parallels cross. RefusedError where they do not: the tool would cut into the path."""
    found = shared(first.shifted, second.shifted, REACH_MM, first.begin_mm)
    if found is None:
        if abs(turn) < NEARLY_SMOOTH_RAD and along(first.shifted, first.end) >= first.begin_mm:
            meet_halfway(first, second)
            return
        reason = (
            f"the tool, {abs(first.offset_mm):g} mm in radius, would gouge at this inside corner; a smaller tool or longer moves"
        )
        raise RefusedError("", reason, second.place)
    first.end = second.begin = found
    second.begin_mm = along(second.shifted, found)


def change_sides(first: Side, second: Side) -> None:
    """From one side of the path to the other: where the two cross, else straight over from one end to the other's start."""
    found = shared(first.shifted, second.shifted, REACH_MM, first.begin_mm)
    if found is None:
        first.bridges.append(Piece(first.end, second.begin))
        return
    first.end = second.begin = found
    second.begin_mm = along(second.shifted, found)


def outside(first: Side, second: Side, turn: float) -> None:
    """Round an outside corner on straight lines: to where the tangents cross, or over two points where that is far away."""
    corner, distance = first.programmed.end, first.offset_mm
    one, other = normal(first.programmed, corner, distance), normal(second.programmed, corner, distance)
    if abs(turn) <= math.pi / 2.0 + SMOOTH_RAD:
        share = 1.0 + math.cos(turn)
        points = [(corner[0] + (one[0] + other[0]) / share, corner[1] + (one[1] + other[1]) / share)]
    else:
        ahead, back = tangent(first.programmed, corner), tangent(second.programmed, second.programmed.start)
        reach = abs(distance)
        points = [
            (corner[0] + one[0] + reach * ahead[0], corner[1] + one[1] + reach * ahead[1]),
            (corner[0] + other[0] - reach * back[0], corner[1] + other[1] - reach * back[1]),
        ]
    stops = list(points)
    if first.shifted.centre is None:
        first.end = stops.pop(0)
    last = points[-1]
    if second.shifted.centre is None:
        second.begin = last
    else:
        stops.append(second.begin)
    here = first.end
    for stop in stops:
        first.bridges.append(Piece(here, stop))
        here = stop


def put_out(out: list[Move], side: Side, position: Position, plane: int) -> Position:
    """The motion as it is now, what came behind it, and the way round the corner; returns where the tool is then."""
    changed = trimmed(side.shifted, side.begin, side.end)
    moved = rebuilt(side.move, position, changed, plane)
    out.append(moved)
    position = moved.end_mm
    for event in side.events:
        if isinstance(event, Rapid | Linear):
            shifted = event._replace(end_mm=placed(event.end_mm, side.end, plane))
            position = shifted.end_mm
            out.append(shifted)
        else:
            out.append(event)
    for bridge in side.bridges:
        end = placed(position, bridge.end, plane)
        out.append(straight(side.move, end) if bridge.centre is None else rounded(side.move, position, bridge, plane))
        position = end
    return position
