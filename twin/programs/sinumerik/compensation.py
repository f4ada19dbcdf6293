"""G41, G42, G40 with G450, G451, NORM, KONT and OFFN: the section between is kept, and worked out whole (`cutter_path`).

NORM approaches square to the first contour block. KONT does so too where the tool starts on its own side of the contour's
tangent; behind it, KONT would go round the start, which is not read. CFC and CFIN make the feed that of the contour: on an arc
the centre goes faster or slower by its own radius over the contour's.
"""

import math
from typing import Final

from twin.programs.canonical import Arc, Motion, Position
from twin.programs.cutter_path import REACH_MM, CompensatedSection, compensated
from twin.programs.pieces import in_plane, placed
from twin.programs.refusal import RefusedError
from twin.programs.settings import LeadIn, OutsideCorner
from twin.programs.sinumerik.codes import ARC_CODES
from twin.programs.sinumerik.state import Compensation, State
from twin.programs.sinumerik.tool import tool_radius
from twin.programs.sinumerik.words import Words

CORNERS: Final = {"G450": OutsideCorner.ARC, "G451": OutsideCorner.CROSSING}


def switch(state: State, words: Words) -> None:
    """G40, G41, G42."""
    code, text = words.codes["cutter"], words.written["cutter"]
    current = state.compensation
    if code == "G40":
        state.modal["cutter"] = code
        if current is not None:
            current.leaving = True
        return
    if code != state.modal["cutter"] and state.modal["motion"] in ARC_CODES:
        raise RefusedError(text, "begins in a straight move; write G0 or G1")
    if not state.frames.is_flat(state.plane):
        raise RefusedError(text, "the frame tilts the plane; the radius is compensated in the plane of the machine only")
    if state.corner is not None:
        raise RefusedError(text, "cannot stand at a corner; end the corner first")
    left = tool_radius(state, text) + state.allowance_mm
    if (code == "G42") != state.frames.mirrors(state.plane):
        left = -left
    state.modal["cutter"] = code
    if current is not None and current.leaving:
        finish(state)
        current = None
    if current is not None:
        current.left = left
        return
    state.compensation = Compensation(CompensatedSection(state.position, state.plane), left)
    state.out = state.compensation.section.moves


def refuse_inside(state: State, text: str) -> None:
    """Refuse what cannot stand between G41 or G42 and G40."""
    if in_force(state):
        raise RefusedError(text, "cannot stand between G41 or G42 and G40; cancel with G40 and a move first")


def in_force(state: State) -> bool:
    """Return True while the tool is beside its path. A section whose G40 was read ends here, even with no move that leaves it."""
    if state.compensation is not None and state.compensation.leaving:
        finish(state)
    return state.compensation is not None


def note(state: State, move: Motion) -> Motion:
    """Remember how far to the left the motion that is put out next goes; returns it with the feed of the contour."""
    current = state.compensation
    assert current is not None
    section = current.section
    section.offsets_mm[len(section.moves)] = None if current.leaving else current.left
    if isinstance(move, Arc) and not current.leaving:
        return contour_feed(state, move, current.left)
    return move


def contour_feed(state: State, move: Arc, left: float) -> Arc:
    """CFC: the feed holds at the contour; CFIN: where the centre's arc is the smaller one only; CFTCP: at the centre."""
    mode = state.modal["contour_feed"]
    radius = math.dist(in_plane(move.end_mm, move.plane), in_plane(move.centre_mm, move.plane))
    ratio = (radius - math.copysign(left, left * move.sweep_rad)) / radius if radius > 0.0 else 1.0
    if mode == "CFTCP" or ratio <= 0.0 or (mode == "CFIN" and ratio > 1.0):
        return move
    per_rev = None if move.feed_per_rev_mm is None else move.feed_per_rev_mm * ratio
    return move._replace(feed_mm_min=move.feed_mm_min * ratio, feed_per_rev_mm=per_rev, feed_ratio=ratio)


def after_move(state: State, start: Position) -> None:
    """A motion was put out: behind G40, the first one in the plane ends the section."""
    current = state.compensation
    if current is None or not current.leaving:
        return
    plane = current.section.plane
    if math.dist(in_plane(start, plane), in_plane(state.position, plane)) > REACH_MM:
        finish(state)


def finish(state: State) -> None:
    """Work out the section and put it out."""
    current = state.compensation
    if current is None:
        return
    section = current.section
    state.compensation, state.out = None, state.moves
    if state.modal["approach"] == "KONT":
        starts_in_front(section)
    moves, position = compensated(section, LeadIn.NEXT, CORNERS[state.modal["corner"]])
    state.moves.extend(moves)
    state.position = placed(state.position, in_plane(position, section.plane), section.plane)


def starts_in_front(section: CompensatedSection) -> None:
    """RefusedError where KONT would go round the start of the contour."""
    places = [section.start_mm]
    for index, move in enumerate(section.moves):
        end = getattr(move, "end_mm", None)
        if end is None or math.dist(in_plane(end, section.plane), in_plane(places[-1], section.plane)) < REACH_MM:
            continue
        places.append(end)
        if len(places) == 3:
            before, corner, after = (in_plane(place, section.plane) for place in places)
            if isinstance(move, Arc):
                centre = in_plane(move.centre_mm, section.plane)
                turn = math.copysign(1.0, move.sweep_rad)
                along = (-turn * (corner[1] - centre[1]), turn * (corner[0] - centre[0]))
            else:
                along = (after[0] - corner[0], after[1] - corner[1])
            left = along[0] * (before[1] - corner[1]) - along[1] * (before[0] - corner[0])
            side = section.offsets_mm.get(index) or 0.0
            if left * side < -REACH_MM:
                reason = "KONT from behind goes round the start, which is not read; start on the tool's side, or write NORM"
                raise RefusedError("KONT", reason, (move.line, move.program))
            return
