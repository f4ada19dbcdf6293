"""The offset table: what the numbers of H and D stand for while a program runs."""

from dataclasses import replace
from typing import Final

from twin.programs.fanuc.state import State
from twin.programs.refusal import RefusedError
from twin.programs.settings import OffsetLookup, ToolOffset

OFFSET_NUMBER_MAX: Final = 999


def tool_offset(state: State, number: int | None, text: str) -> ToolOffset:
    """The table's line of that number; None = what `Settings.offset_lookup` says; number 0 is no offset."""
    if number is None:
        number = state.tool if state.settings.offset_lookup is OffsetLookup.TOOL else 0
    if number == 0:
        return ToolOffset()
    found = state.tool_offsets.get(number)
    if found is None:
        raise RefusedError(text, f"the offset table has no number {number}; [control] tool_offsets or G10 L10 to L13 sets it")
    return found


def set_length(state: State, text: str) -> None:
    length = 0.0
    if state.modal.length != 490:
        offset = tool_offset(state, state.length_number, text) if state.tool_offsets else ToolOffset()
        length = offset.length_mm + offset.length_wear_mm
    if state.modal.length == 440:
        length = -length
    if length != state.coordinates.tool[2]:
        state.coordinates.tool[2] = length
        state.coordinates.refresh()
        state.length_is_due = True


def change_tool(state: State, number: int, column: str, value: float, adds: bool = False) -> None:
    """Enter a figure of the offset table, mm; a length in force follows at once."""
    before = state.tool_offsets.get(number, ToolOffset())
    value += getattr(before, column) if adds else 0.0
    state.tool_offsets[number] = replace(before, **{column: value})
    if state.modal.length != 490 and state.length_number is not None:
        set_length(state, "")
