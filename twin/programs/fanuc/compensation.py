"""G41, G42, G40: the section from G41 or G42 to its G40 is kept, and worked out whole (`twin.programs.cutter_path`)."""

import math

from twin.programs.canonical import Motion, Position
from twin.programs.cutter_path import REACH_MM, compensated
from twin.programs.fanuc.block import Words
from twin.programs.fanuc.state import Compensation, State
from twin.programs.fanuc.tool_table import OFFSET_NUMBER_MAX, tool_offset
from twin.programs.pieces import in_plane, placed
from twin.programs.refusal import RefusedError
from twin.programs.settings import OffsetLookup


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
    state.compensation = Compensation(state.position, state.plane, left=left)
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
    moves, position = compensated(section, state.settings.lead_in, state.settings.outside_corner)
    state.moves.extend(moves)
    state.position = placed(state.position, in_plane(position, section.plane), section.plane)
