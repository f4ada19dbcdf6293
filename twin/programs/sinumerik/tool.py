"""T, M6 and D: the tool in the spindle, its length and its radius.

`Settings.tool_offsets` has one edge a tool, by the number of the tool: D1 is that edge, D0 is none. Without any table lengths
are 0. The length acts along z in every plane, as mills are set up ($SC_TOOL_LENGTH_CONST = 17), from the next move of z on.
"""

from typing import Final

from twin.programs.canonical import ToolChange
from twin.programs.refusal import RefusedError
from twin.programs.settings import ToolOffset
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.words import Given, Words

TOOL_MAX: Final = 99_999_999
EDGE_MAX: Final = 12
Z: Final = 2


def tool_number(state: State, given: Given) -> int:
    """T5, T="5", T="CUTTER 10": a name is looked up in `Settings.tool_numbers`."""
    if not isinstance(given.value, str):
        return given.whole(0, TOOL_MAX)
    name = given.value
    numbers = {known.upper(): number for known, number in state.settings.tool_numbers.items()}
    if name.upper() in numbers:
        return numbers[name.upper()]
    if name.isdecimal() and len(name) <= 8:
        return int(name)
    raise RefusedError(given.text, "the number of this tool is not known; [control] tool_numbers gives it")


def select(state: State, words: Words) -> None:
    """T, M6 and D of a block, in this order; a tool change takes edge 1 where the block has no D."""
    if "T" in words.values:
        state.preselected = tool_number(state, words.values["T"])
    if 6 in words.m:
        if state.preselected is None:
            raise RefusedError("M6", "no tool was chosen; write T")
        if state.compensation is not None and not state.compensation.leaving:
            raise RefusedError("M6", "cannot stand between G41 or G42 and G40; cancel with G40 first")
        state.tool, state.edge = state.preselected, 1
        state.emit(ToolChange(state.line, state.tool, state.program))
    if "D" in words.values:
        edge = words.values["D"].whole(0, EDGE_MAX)
        if state.compensation is not None and not state.compensation.leaving and edge != state.edge:
            raise RefusedError(words.values["D"].text, "the edge cannot change in G41 or G42; cancel with G40 first")
        state.edge = edge
    if 6 in words.m or "D" in words.values:
        set_length(state, words.values["D"].text if "D" in words.values else "M6")


def offset(state: State, text: str) -> ToolOffset:
    """The edge in force."""
    if state.edge == 0 or state.tool == 0:
        return ToolOffset()
    if state.edge > 1:
        raise RefusedError(text, "the offset table has one edge a tool, D1; enter this edge as a tool of its own")
    found = state.tool_offsets.get(state.tool)
    if found is None:
        raise RefusedError(text, f"the offset table has no tool {state.tool}; [control] tool_offsets sets it")
    return found


def set_length(state: State, text: str) -> None:
    """Let the length of the edge in force act."""
    edge = offset(state, text) if state.tool_offsets else ToolOffset()
    length = edge.length_mm + edge.length_wear_mm
    if length != state.frames.tool[Z]:
        state.frames.tool[Z] = length
        state.length_is_due = True


def tool_radius(state: State, text: str) -> float:
    """The radius of the edge in force, with its wear; RefusedError where it is not known."""
    if not state.tool_offsets:
        raise RefusedError(text, "needs the radius of the tool; [control] tool_offsets gives it")
    if state.tool == 0:
        raise RefusedError(text, "needs the radius of the tool, and none is in the spindle; write T and M6")
    edge = offset(state, text)
    return edge.radius_mm + edge.radius_wear_mm


def cutter_radius(state: State, text: str) -> float:
    """The radius of a milling cycle's tool: more than 0."""
    radius = tool_radius(state, text)
    if radius <= 0.0:
        raise RefusedError(text, f"needs a tool with a radius; tool {state.tool}, D{state.edge}, has {radius:g} mm")
    return radius
