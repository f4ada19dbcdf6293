"""G41, G42, G40: the path of the tool's centre, beside the programmed one by the tool's radius.

Each motion in the plane is moved to its side (a parallel). Where two meet at an inside corner, both end where their parallels
cross; at an outside corner the tool goes round it (`Settings.outside_corner`). Where a motion would have to run backwards, the
tool would cut into what it must not touch: an error (the interference check of a control). The section from G41 or G42 to its G40
is kept, and worked out whole. From one side to the other the tool goes where the two paths cross, else straight over.
Source: operator's manual B-64604EN, "cutter compensation"; checked against rs274 with its arcs and its lead-in.
"""

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

from twin.gcode.arcs import Point
from twin.gcode.block import Words
from twin.gcode.canonical import Arc, Linear, Move, Position, Rapid
from twin.gcode.pieces import in_plane, piece, placed, rebuilt, rounded, straight
from twin.gcode.planar import Piece, along, extent, left_of, parallel, shared, tangent, trimmed, turn_between
from twin.gcode.refusal import RefusedError
from twin.gcode.settings import LeadIn, OffsetLookup, OutsideCorner, Settings
from twin.gcode.state import Compensation, Motion, State
from twin.gcode.tool_table import OFFSET_NUMBER_MAX, tool_offset

REACH_MM: Final = 1e-6
SMOOTH_RAD: Final = 1e-3
"""Below this change of direction two motions are one smooth line: at 10 mm radius the two ends are 10 µm apart along it."""
NEARLY_SMOOTH_RAD: Final = 0.035
"""Up to this one, an inside corner whose parallels miss each other by the rounding of the program is taken as smooth."""


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


def switch(state: State, words: Words) -> None:
    """G40, G41, G42."""
    code, text = words.codes["cutter"], words.written["cutter"]
    current = state.compensation
    if code == 400:
        state.modal.cutter = 400
        if current is not None:
            current.leaving = True
        return
    if "D" in words.values:
        number = words.integer("D", 0, OFFSET_NUMBER_MAX)
        if current is not None and number != state.radius_number:
            raise RefusedError(words.texts["D"], "the radius cannot change in G41 or G42; cancel with G40 first")
        state.radius_number = number
    elif state.settings.offset_lookup is OffsetLookup.TOOL and current is None:
        state.radius_number = None
    if code != state.modal.cutter and state.modal.motion in (20, 30):
        raise RefusedError(text, "begins in a straight move; write G0 or G1")
    offset = tool_offset(state, state.radius_number, words.texts.get("D", text))
    radius = offset.radius_mm + offset.radius_wear_mm
    left = radius if code == 410 else -radius
    state.modal.cutter = code
    if current is not None and current.leaving:
        finish(state)
        current = None
    if current is not None:
        current.left = left
        return
    if state.corner is not None:
        raise RefusedError(text, "cannot stand at a corner; end the corner first")
    state.compensation = Compensation(state.position, state.plane, abs(radius), left)
    state.out = state.compensation.moves


def note(state: State, move: Motion) -> None:
    """Remember how far to the left the motion that is put out next goes."""
    section = state.compensation
    assert section is not None
    section.offsets_mm[len(section.moves)] = None if section.leaving else section.left


def in_force(state: State) -> bool:
    """Return True while the tool is beside its path. A section whose G40 was read ends here, even with no move that leaves it."""
    if state.compensation is not None and state.compensation.leaving:
        finish(state)
    return state.compensation is not None


def after_move(state: State, start: Position) -> None:
    """A motion was put out: behind G40, the first one in the plane ends the section."""
    section = state.compensation
    if section is None or not section.leaving:
        return
    if math.dist(in_plane(start, section.plane), in_plane(state.position, section.plane)) > REACH_MM:
        finish(state)


def finish(state: State) -> None:
    """Work out the section and put it out."""
    section = state.compensation
    if section is None:
        return
    state.compensation, state.out = None, state.moves
    before: list[Move] = []
    sides = collect(section, before)
    for first, second in pairwise(sides):
        join(first, second, first is sides[0], state.settings)
    position = section.start_mm
    for move in before:
        state.moves.append(move)
        position = getattr(move, "end_mm", position)
    for side in sides:
        position = put_out(state, side, position, section.plane)
    state.position = placed(state.position, in_plane(position, section.plane), section.plane)


def collect(section: Compensation, before: list[Move]) -> list[Side]:
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
            text = "G40" if leaves else "G41"
            raise RefusedError(text, "cutter compensation begins and ends in a straight move", (move.line, move.program))
        shifted = parallel(programmed, offset or 0.0)
        if shifted is None:
            reason = f"the tool, {abs(offset or 0.0):g} mm in radius, does not fit into this arc of {programmed.radius:g} mm"
            raise RefusedError("", reason, (move.line, move.program))
        sides.append(Side(move, programmed, offset or 0.0, shifted, leaves, shifted.start, shifted.end))
    return sides


def join(first: Side, second: Side, leads_in: bool, settings: Settings) -> None:
    """Settle where the tool leaves one motion for the next."""
    if leads_in and settings.lead_in is LeadIn.OWN and extent(first.programmed) <= abs(first.offset_mm):
        raise RefusedError("", "the move that leads in is not longer than the tool's radius", first.place)
    if second.leaves or first.leaves:
        second.begin = first.end
    elif leads_in and settings.lead_in is LeadIn.NEXT:
        first.end = second.begin
    elif first.offset_mm != second.offset_mm:
        change_sides(first, second)
    elif first.offset_mm != 0.0:
        turn = turn_between(first.programmed, second.programmed)
        if abs(turn) < SMOOTH_RAD:
            meet_halfway(first, second)
        elif turn * first.offset_mm > 0.0:
            inside(first, second, turn)
        elif settings.outside_corner is OutsideCorner.ARC and not isinstance(first.move, Rapid):
            sweep = turn
            first.bridges.append(Piece(first.end, second.begin, first.programmed.end, sweep))
        else:
            outside(first, second, turn)


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


def put_out(state: State, side: Side, position: Position, plane: int) -> Position:
    """The motion as it is now, what came behind it, and the way round the corner; returns where the tool is then."""
    changed = trimmed(side.shifted, side.begin, side.end)
    moved = rebuilt(side.move, position, changed, plane)
    state.moves.append(moved)
    position = moved.end_mm
    for event in side.events:
        if isinstance(event, Rapid | Linear):
            shifted = event._replace(end_mm=placed(event.end_mm, side.end, plane))
            position = shifted.end_mm
            state.moves.append(shifted)
        else:
            state.moves.append(event)
    for bridge in side.bridges:
        end = placed(position, bridge.end, plane)
        state.moves.append(straight(side.move, end) if bridge.centre is None else rounded(side.move, position, bridge, plane))
        position = end
    return position
