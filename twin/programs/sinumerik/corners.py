"""CHF=, CHR=, RND=, RNDM=: a chamfer or a rounding between this block and the next; FRC= and FRCM= are its feed.

CHR is the length of the two sides that a chamfer cuts off, CHF that of the chamfer itself ("Fundamentals", chapter "Chamfer,
rounding"). Where one does not fit, a control makes it smaller by a rule that is not published: that is refused here.
"""

import math
from typing import Final, NamedTuple

from twin.programs.canonical import Arc, ExactStop, Linear, Motion, Position, Rapid
from twin.programs.corner_pieces import REACH_MM, STRAIGHT_RAD, chamfer, joined, rounding
from twin.programs.pieces import piece
from twin.programs.planar import extent, turn_between
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.codes import CONTOUR_CODES
from twin.programs.sinumerik.compensation import note
from twin.programs.sinumerik.state import PendingCorner, State
from twin.programs.sinumerik.words import Words

NAMES: Final = ("CHF", "CHR", "RND")


class Corner(NamedTuple):
    """The corner behind a block, as the block programs it."""

    kind: str
    size_mm: float
    text: str
    feed: float | None
    is_modal: bool


def modes(state: State, words: Words) -> None:
    """RNDM= and FRCM= stay until they are 0."""
    if "RNDM" in words.values:
        state.rounding_mm = size_of(state, words, "RNDM")
    if "FRCM" in words.values:
        value = words.number("FRCM") * state.feed_unit_mm
        state.corner_feed = value if value > 0.0 else None


def size_of(state: State, words: Words, name: str) -> float:
    given = words.values[name]
    size = given.number * state.unit_mm
    if not 0.0 <= size < math.inf:
        raise RefusedError(given.text, "the size of a corner is at least 0")
    return size


def wanted(state: State, words: Words) -> Corner | None:
    """The corner that this block asks for, if any."""
    named = [name for name in NAMES if name in words.values]
    mode = state.modal["motion"]
    if len(named) > 1:
        raise RefusedError(words.values[named[1]].text, "a block has one corner: CHF=, CHR= or RND=")
    if named and mode not in CONTOUR_CODES:
        raise RefusedError(words.values[named[0]].text, f"stands in a block of G1, G2 or G3, not {mode}")
    feed = state.corner_feed
    if "FRC" in words.values:
        feed = words.number("FRC") * state.feed_unit_mm
        if feed <= 0.0:
            raise RefusedError(words.values["FRC"].text, "a feed is more than 0")
    if named:
        size = size_of(state, words, named[0]) * state.frames.arc_scale(state.plane, named[0])
        return Corner(named[0], size, words.values[named[0]].text, feed, False) if size > 0.0 else None
    if state.rounding_mm > 0.0 and mode in CONTOUR_CODES:
        size = state.rounding_mm * state.frames.arc_scale(state.plane, "RNDM")
        return Corner("RND", size, "RNDM", feed, True)
    return None


def begin(state: State, corner: Corner, start: Position) -> None:
    """Keep the move just put out, until the next tells where its corner goes."""
    at = len(state.out) - (2 if isinstance(state.out[-1], ExactStop) else 1)
    if not isinstance(state.out[at], Rapid | Linear | Arc):
        return
    if extent(piece(start, kept(state, at), state.plane)) < REACH_MM:
        if corner.is_modal:
            return
        raise RefusedError(corner.text, "a corner needs a move in the plane before it")
    state.corner = PendingCorner(at, start, corner.kind, corner.size_mm, corner.text, corner.feed, corner.is_modal)


def kept(state: State, at: int) -> Motion:
    found = state.out[at]
    assert isinstance(found, Rapid | Linear | Arc)
    return found


def abandoned(state: State) -> None:
    """The program does something else at a corner: a rounding of RNDM is left out, one of its own block is an error."""
    pending = state.corner
    state.corner = None
    if pending is not None and not pending.is_modal:
        raise RefusedError(pending.text, "the next motion has to be a cut in the plane, G1, G2 or G3")


def close(state: State, move: Motion) -> Motion:
    """Put the corner between the kept move and this one; returns this one as it is left."""
    pending = state.corner
    assert pending is not None
    plane, before = state.plane, kept(state, pending.at)
    first, second = piece(pending.start_mm, before, plane), piece(state.position, move, plane)
    if isinstance(move, Rapid) or extent(second) < REACH_MM:
        abandoned(state)
        return move
    state.corner = None
    turn = turn_between(first, second)
    if abs(turn) < STRAIGHT_RAD:
        return move
    if pending.kind == "RND":
        found = rounding(first, second, pending.size_mm, turn)
    else:
        side = pending.size_mm if pending.kind == "CHR" else pending.size_mm / 2.0 / max(math.cos(turn / 2.0), REACH_MM)
        found = chamfer(first, second, side)
    if found is None:
        if pending.is_modal:
            return move
        raise RefusedError(pending.text, f"{pending.size_mm:g} mm do not fit between these two moves; a smaller one fits")
    parts = joined(before, pending.start_mm, first, move, second, found, plane)
    state.out[pending.at], put = parts.before, parts.corner
    if pending.feed_mm_min is not None and not isinstance(put, Rapid):
        put = put._replace(feed_mm_min=pending.feed_mm_min)
    insert(state, pending.at + 1, put)
    state.position = parts.end_mm
    return parts.behind


def insert(state: State, at: int, move: Motion) -> None:
    """Put a motion behind its block; what was put out in between, a dwell, comes after it."""
    later = state.out[at:]
    del state.out[at:]
    if state.compensation is not None:
        move = note(state, move)
    state.out.append(move)
    state.out.extend(later)
