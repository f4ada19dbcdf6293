"""`,C` and `,R`: a chamfer or a rounding between this move and the next.

,R: an arc of that radius touching both; its centre is where their parallels at that distance on the inner side cross. ,C: a
straight line between the two points at that distance from the corner. Both belong to the block that names them.
"""

import math
from typing import Final

from twin.gcode.arcs import Point
from twin.gcode.block import Words
from twin.gcode.canonical import Arc, ExactStop, Linear, Position
from twin.gcode.compensation import note
from twin.gcode.pieces import piece, placed, rebuilt, rounded, straight
from twin.gcode.planar import Piece, along, crossings, extent, left_of, parallel, shared, tangent, trimmed, turn_between
from twin.gcode.refusal import RefusedError
from twin.gcode.settings import IntegerWords
from twin.gcode.state import Motion, PendingCorner, State

STRAIGHT_RAD: Final = 1e-6
REACH_MM: Final = 1e-6


def begin(state: State, words: Words, start: Position) -> None:
    """Keep the move just put out, until the next tells where its corner goes."""
    assert words.corner is not None
    kind, value, integer = words.corner
    fine = integer and state.settings.integer_words is IntegerWords.INCREMENTS
    size = value * (state.increment if fine else 1.0) * state.unit_mm * state.coordinates.arc_scale(state.plane)
    text = f",{kind}{value:g}"
    if size < 0.0:
        raise RefusedError(text, "the size of a corner is more than 0")
    if size > 0.0:
        at = len(state.out) - (2 if isinstance(state.out[-1], ExactStop) else 1)
        state.corner = PendingCorner(at, start, kind, size, text)


def close(state: State, move: Motion) -> Motion:
    """Put the corner between the kept move and this one; returns this one as it is left."""
    pending = state.corner
    assert pending is not None
    state.corner = None
    kept = state.out[pending.at]
    if not isinstance(move, Linear | Arc) or not isinstance(kept, Linear | Arc):
        raise RefusedError(pending.text, "the block after a corner has to be a cut, G1, G2 or G3")
    plane = state.plane
    first, second = piece(pending.start_mm, kept, plane), piece(state.position, move, plane)
    if extent(first) < REACH_MM or extent(second) < REACH_MM:
        raise RefusedError(pending.text, "a corner needs two moves in the plane")
    turn = turn_between(first, second)
    if abs(turn) < STRAIGHT_RAD:
        return move
    found = chamfer(first, second, pending) if pending.kind == "C" else rounding(first, second, pending, turn)
    if found is None:
        raise RefusedError(pending.text, f"{pending.size_mm:g} mm do not fit between these two moves; a smaller one fits")
    between = found
    shorter = rebuilt(kept, pending.start_mm, trimmed(first, end=between.start), plane)
    state.out[pending.at] = shorter
    corner_start = placed(kept.end_mm, between.start, plane)
    corner_end = placed(kept.end_mm, between.end, plane)
    put = straight(kept, corner_end) if between.centre is None else rounded(kept, corner_start, between, plane)
    insert(state, pending.at + 1, put)
    state.position = corner_end
    return rebuilt(move, corner_end, trimmed(second, start=between.end), plane)


def insert(state: State, at: int, move: Motion) -> None:
    """Put a motion behind its block; what was put out in between, a dwell, comes after it."""
    later = state.out[at:]
    del state.out[at:]
    if state.compensation is not None:
        note(state, move)
    state.out.append(move)
    state.out.extend(later)


def chamfer(first: Piece, second: Piece, pending: PendingCorner) -> Piece | None:
    corner = first.end
    begin_at = point_at(first, corner, pending.size_mm, at_end=True)
    end_at = point_at(second, corner, pending.size_mm, at_end=False)
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


def rounding(first: Piece, second: Piece, pending: PendingCorner, turn: float) -> Piece | None:
    inner = math.copysign(pending.size_mm, turn)
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
