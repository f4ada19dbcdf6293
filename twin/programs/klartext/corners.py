"""RND and CHF: a rounding or a chamfer between the move before and the move behind.

The feed of such a block holds for the corner alone (User's Manual TNC 640, "Rounded corners RND", "Inserting a chamfer CHF").
"""

from twin.programs.canonical import Arc, Linear, Motion, Rapid
from twin.programs.corner_pieces import REACH_MM, STRAIGHT_RAD, chamfer, joined, rounding
from twin.programs.klartext import compensation
from twin.programs.klartext.state import PendingCorner, State
from twin.programs.pieces import piece
from twin.programs.planar import extent, turn_between
from twin.programs.refusal import RefusedError


def begin(state: State, rounds: bool, size_mm: float, feed_mm_min: float | None, text: str) -> None:
    """Keep the move just put out, until the next one tells where its corner goes."""
    if size_mm < 0.0:
        raise RefusedError(text, "the size of a corner is more than 0")
    if state.corner is not None:
        raise RefusedError(text, "stands behind another corner; a move has to stand between")
    at = len(state.out) - 1
    while at >= 0 and not isinstance(state.out[at], Rapid | Linear | Arc):
        at -= 1
    if state.last is None or at < 0 or state.out[at] is not state.last[1]:
        raise RefusedError(text, "needs a move of the contour just before")
    if size_mm > 0.0:
        state.corner = PendingCorner(at, state.last[0], rounds, size_mm, feed_mm_min, state.line, text)


def close(state: State, move: Motion) -> Motion:
    """Put the corner between the kept move and this one; returns this one as it is left."""
    pending = state.corner
    assert pending is not None
    state.corner = None
    kept = state.out[pending.at]
    if not isinstance(move, Linear | Arc) or not isinstance(kept, Linear | Arc):
        raise RefusedError(pending.text, "stands between two moves with a feed; one of them is FMAX")
    plane = state.plane
    first, second = piece(pending.start_mm, kept, plane), piece(state.position, move, plane)
    if extent(first) < REACH_MM or extent(second) < REACH_MM:
        raise RefusedError(pending.text, "a corner needs two moves in the working plane")
    turn = turn_between(first, second)
    if abs(turn) < STRAIGHT_RAD:
        return move
    between = rounding(first, second, pending.size_mm, turn) if pending.rounds else chamfer(first, second, pending.size_mm)
    if between is None:
        reason = f"{pending.size_mm:g} mm do not fit between these two moves; a smaller one fits"
        raise RefusedError(pending.text, reason, (pending.line, state.program))
    parts = joined(kept, pending.start_mm, first, move, second, between, plane)
    state.out[pending.at], put = parts.before, parts.corner
    assert not isinstance(put, Rapid)
    put = put._replace(line=pending.line, feed_mm_min=pending.feed_mm_min or put.feed_mm_min)
    state.position = parts.begin_mm
    insert(state, pending.at + 1, compensation.at_the_edge(state, put))
    state.position = parts.end_mm
    return parts.behind


def insert(state: State, at: int, move: Motion) -> None:
    """Put a motion behind the kept one; what was put out in between comes after it."""
    later = state.out[at:]
    del state.out[at:]
    if state.compensation is not None:
        compensation.note(state, leaves=False)
    state.out.append(move)
    state.out.extend(later)
