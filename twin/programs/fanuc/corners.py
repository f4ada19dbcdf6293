"""`,C` and `,R`: a chamfer or a rounding (`twin.programs.corner_pieces`) between this move and the next.

Both belong to the block that names them.
"""

from twin.programs.canonical import Arc, ExactStop, Linear, Motion, Position
from twin.programs.corner_pieces import REACH_MM, STRAIGHT_RAD, chamfer, joined, rounding
from twin.programs.fanuc.block import Words
from twin.programs.fanuc.compensation import note
from twin.programs.fanuc.state import PendingCorner, State
from twin.programs.pieces import piece
from twin.programs.planar import extent, turn_between
from twin.programs.refusal import RefusedError
from twin.programs.settings import IntegerWords


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
    found = chamfer(first, second, pending.size_mm) if pending.kind == "C" else rounding(first, second, pending.size_mm, turn)
    if found is None:
        raise RefusedError(pending.text, f"{pending.size_mm:g} mm do not fit between these two moves; a smaller one fits")
    parts = joined(kept, pending.start_mm, first, move, second, found, plane)
    state.out[pending.at] = parts.before
    insert(state, pending.at + 1, parts.corner)
    state.position = parts.end_mm
    return parts.behind


def insert(state: State, at: int, move: Motion) -> None:
    """Put a motion behind its block; what was put out in between, a dwell, comes after it."""
    later = state.out[at:]
    del state.out[at:]
    if state.compensation is not None:
        note(state, move)
    state.out.append(move)
    state.out.extend(later)
