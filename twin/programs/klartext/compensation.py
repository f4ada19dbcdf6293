"""R0, RL, RR: the path of the tool's centre, worked out from one R0 to the next (`twin.programs.cutter_path`).

The first move ends beside the start of the next one, square to it; the tool leaves beside the end of the last one; round outside
corners it goes on an arc (User's Manual TNC 640, "Tool radius compensation").
"""

from itertools import pairwise

from twin.programs.arcs import Point
from twin.programs.canonical import Arc, Linear, Motion, Move, Position, Rapid
from twin.programs.cutter_path import REACH_MM, CompensatedSection, Side, collect, join, put_out
from twin.programs.klartext.approach import draw
from twin.programs.klartext.state import EdgeFeed, State
from twin.programs.pieces import in_plane, piece, placed
from twin.programs.planar import Piece, extent, parallel, tangent
from twin.programs.refusal import RefusedError
from twin.programs.settings import LeadIn, OutsideCorner


def in_force(state: State) -> bool:
    """Return True while the tool is beside its path. A section without a radius, that of APPR with R0, ends here."""
    if state.compensation is not None and state.side == 0:
        finish(state)
    return state.compensation is not None


def refuse(state: State, text: str) -> None:
    """RefusedError where compensation is in force."""
    if in_force(state):
        raise RefusedError(text, "cannot stand between RL or RR and R0; write a move with R0, or DEP, before")


def switch(state: State, word: str | None) -> bool:
    """R0, RL or RR of the block that comes; returns True where its move is the one that leaves the contour."""
    if word is None:
        return False
    side = {"R0": 0, "RL": 1, "RR": -1}[word]
    if side == 0:
        return in_force(state)
    if state.side and side != state.side:
        raise RefusedError(word, "cannot follow the other side at once; write a move with R0 between RL and RR")
    if not state.side:
        begin(state, side, word)
    return False


def begin(state: State, side: int, word: str) -> None:
    """Begin a section; side 0: the contour itself."""
    if state.compensation is not None:
        finish(state)
    if state.corner is not None:
        raise RefusedError(word, "cannot stand at a corner; end RND or CHF first")
    state.side = side
    mirrored = state.frame.mirrors(state.plane)
    state.left_mm = side * (-1.0 if mirrored else 1.0) * state.radius_mm(word) if side else 0.0
    state.compensation = CompensatedSection(state.position, state.plane, on=word, off="R0")
    state.out = state.compensation.moves


def at_the_edge(state: State, move: Motion) -> Motion:
    """M109, M110: an arc with the feed at which its tool's edge runs along the contour at the programmed one.

    The centre's feed is F (R - d) / R, with d the tool's radius, + towards the arc's centre.
    """
    if state.edge_feed is EdgeFeed.NONE or state.compensation is None or not isinstance(move, Arc):
        return move
    programmed = piece(state.position, move, state.plane)
    shifted = parallel(programmed, state.left_mm)
    if shifted is None or (state.edge_feed is EdgeFeed.INNER_ARCS and shifted.radius > programmed.radius):
        return move
    ratio = shifted.radius / programmed.radius
    return move._replace(feed_mm_min=move.feed_mm_min * ratio, feed_ratio=ratio)


def leave_open(state: State) -> None:
    """M98: at the inner corner behind this move the tool goes on to its very end, and from there to the start of the next."""
    if state.compensation is not None and state.last is not None:
        state.open_corners.append(state.last[1])


def note(state: State, leaves: bool) -> None:
    """Remember how far to the left the motion that is put out next goes."""
    section = state.compensation
    assert section is not None
    section.offsets_mm[len(section.moves)] = None if leaves else state.left_mm


def finish(state: State) -> Point | None:
    """Work out the section and put it out. Returns the direction at the end of the contour, if there was one."""
    section, approach = state.compensation, state.approach
    if section is None:
        return None
    state.compensation, state.approach, state.out, state.side = None, None, state.moves, 0
    before: list[Move] = []
    sides = collect(section, before)
    for first, second in pairwise(sides):
        if any(first.move is move for move in state.open_corners) and not second.leaves and first is not sides[0]:
            first.bridges.append(Piece(first.end, second.begin))
        else:
            join(first, second, first is sides[0], LeadIn.NEXT, OutsideCorner.ARC)
    state.open_corners = []
    if approach is not None and len(sides) < 2:
        place = (approach.first.line, approach.first.program)
        raise RefusedError("APPR", "needs a contour behind it, in the working plane", place)
    position: Position = section.start_mm
    for move in before:
        state.moves.append(move)
        position = getattr(move, "end_mm", position)
    for at, side in enumerate(sides):
        if at == 0 and approach is not None:
            direction = tangent(sides[1].shifted, sides[1].begin)
            position = draw(state.moves, approach, position, side.end, direction, section.plane)
            position = put_events(state.moves, side, position, section.plane)
        else:
            position = put_out(state.moves, side, position, section.plane)
    state.position = placed(state.position, in_plane(position, section.plane), section.plane)
    return leaving(sides)


def put_events(out: list[Move], side: Side, position: Position, plane: int) -> Position:
    """Return what came between APPR and its contour: moves of the tool's axis stay beside the first point."""
    for event in side.events:
        if isinstance(event, Rapid | Linear):
            position = placed(event.end_mm, side.end, plane)
            out.append(event._replace(end_mm=position))
        else:
            out.append(event)
    return position


def leaving(sides: list[Side]) -> Point | None:
    last = next((side for side in reversed(sides) if not side.leaves), None)
    return None if last is None else tangent(last.shifted, last.end)


def moves_in_plane(state: State, start: Position, move: Motion) -> bool:
    """Return True where a motion has a length in the working plane."""
    return extent(piece(start, move, state.plane)) > REACH_MM
