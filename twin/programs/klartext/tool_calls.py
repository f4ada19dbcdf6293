"""TOOL CALL and TOOL DEF: the tool in the spindle, its axis, speed and deltas; the figures of the tool table."""

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from twin.programs.canonical import ToolChange
from twin.programs.klartext import compensation, m_functions, spindle
from twin.programs.klartext.block import Block, FeedKind, parse
from twin.programs.klartext.numbers import VALUE, Expression, value
from twin.programs.klartext.source import Source
from twin.programs.klartext.state import State, Tool
from twin.programs.refusal import RefusedError

TOOL_MAX: Final = 32_767
HEAD: Final = re.compile(rf"[ \t]*+(?:\"([^\"]*+)\"|QS([0-9]++)|({VALUE}))?+[ \t]*+([XYZ](?![-+0-9.,Q]))?+")
DR2: Final = re.compile(rf"DR2[ \t]*+[:=]?+[ \t]*+{VALUE}")
PLANE_OF_AXIS: Final = {"X": 19, "Y": 18, "Z": 17}


def call(source: Source, begin: int) -> Callable[[State], None]:
    """`TOOL CALL 5 Z S2500 F500 DL+0.2 DR-0.1`; without a tool it changes the speed alone."""
    match = HEAD.match(source.body, begin)
    assert match is not None
    # The delta of the corner radius changes no path in the plane.
    body = DR2.sub(lambda found: " " * len(found.group()), source.body)
    block = parse(source._replace(body=body), match.end(), frozenset({"S", "DL", "DR"}))
    word = source.written[match.start() : match.end() if match.group(4) is None else match.start(4)].strip()
    name = source.written[match.start(1) : match.end(1)] if match.group(1) is not None else None
    string = int(match.group(2)[:9]) if match.group(2) else None
    number = value(match.group(3), word) if match.group(3) else None
    axis = match.group(4)

    def run(state: State) -> None:
        compensation.refuse(state, "TOOL CALL")
        m_functions.before(state, block.m)
        chosen = tool_number(state, name, string, number, word)
        if axis is not None:
            take_axis(state, PLANE_OF_AXIS[axis], axis)
        if chosen is not None:
            change(state, chosen, block)
        speed = block.value(state.variables, "S")
        if speed is not None:
            spindle.set_speed(state, speed, block.texts["S"])
        take_tool_feed(state, block)
        if chosen is not None:
            set_length(state)
        m_functions.after(state, block.m)

    return run


def tool_number(state: State, name: str | None, string: int | None, number: Expression | None, word: str) -> int | None:
    """The number of the tool that is called; None where none is."""
    if string is not None:
        name = state.strings.get(string)
        if name is None:
            raise RefusedError(word, "this string parameter has no value that is known")
    if name is not None:
        if name not in state.settings.tool_numbers:
            raise RefusedError(word, f"no tool is known by the name {name!r}; [control] tool_numbers gives its number")
        return state.settings.tool_numbers[name]
    if number is None:
        return None
    given = number(state.variables)
    # An indexed tool, 5.2, has the number 5.
    whole = int(given)
    if not 0 <= whole <= TOOL_MAX:
        raise RefusedError(word, f"a tool number is from 0 to {TOOL_MAX}")
    return whole


def take_axis(state: State, plane: int, axis: str) -> None:
    """The tool's axis, and with it the working plane."""
    if plane == state.plane:
        return
    if state.frame.angle_deg != 0.0:
        raise RefusedError(axis, "the working plane cannot change in a rotation; cancel cycle 10 with ROT+0 first")
    state.plane = state.frame.plane = plane
    state.pole = None


def change(state: State, number: int, block: Block) -> None:
    """The tool is changed; the spindle stands for it."""
    if number != state.tool.number or number == 0:
        if state.spindle_direction:
            spindle.turn(state, 0)
        state.emit(ToolChange(state.line, number, state.program))
    unit = state.unit_mm
    deltas = [(block.value(state.variables, name) or 0.0) * unit for name in ("DL", "DR")]
    state.tool = Tool(number, deltas[0], deltas[1])


def take_tool_feed(state: State, block: Block) -> None:
    """F of TOOL CALL: the feed in force, and that of F AUTO."""
    if block.feed is None:
        return
    if block.feed is not FeedKind.FIGURE or block.feed_value is None:
        raise RefusedError(block.feed_text, "TOOL CALL takes a figure as its feed")
    state.set_feed(block.feed_value(state.variables), block.feed_text, per_revolution=False)
    state.tool = replace(state.tool, feed_mm_min=state.feed_mm_min)


def set_length(state: State) -> None:
    """The length of the tool is in force from its call on; the next move of its axis contains it."""
    offset = state.tool_offset("TOOL CALL")
    length = offset.length_mm + offset.length_wear_mm + state.tool.length_delta_mm
    if length != 0.0 and state.plane != 17:
        raise RefusedError("TOOL CALL", "a tool along X or Y with a length is not modelled; its length in the table has to be 0")
    if length != state.frame.length_mm:
        state.frame.length_mm = length
        state.frame.refresh()
        state.length_is_due = True


def define(source: Source, begin: int) -> Callable[[State], None]:
    """`TOOL DEF 1 L+0 R+5` enters a line of the tool table; `TOOL DEF 5` only brings the tool near."""
    match = HEAD.match(source.body, begin)
    assert match is not None
    block = parse(source, match.end(), frozenset({"L", "R"}))
    word = source.written[match.start() : match.end()].strip()
    number = value(match.group(3), word) if match.group(3) else None
    # R0 is a radius here.
    radius_zero = block.compensation == "R0"

    def run(state: State) -> None:
        if number is None or (not block.values and not radius_zero):
            return
        length, radius = (block.value(state.variables, name) or 0.0 for name in "LR")
        chosen = int(number(state.variables))
        if not 1 <= chosen <= TOOL_MAX:
            raise RefusedError(word, f"a tool number is from 1 to {TOOL_MAX}")
        state.enter_tool(chosen, length * state.unit_mm, radius * state.unit_mm)
        if chosen == state.tool.number:
            set_length(state)

    return run
