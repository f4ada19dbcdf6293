"""The tool in the spindle of a machine that only says where each of its tools is (OPC 40501-1 has no active tool).

A tool is in the spindle when its Location says so: its Name holds the configured word, or its PlaceNumber is the number.
Between the tool that left and the one that comes there is none, and that is the change.

>>> tools = told(told(told((), 0, "ControlIdentifier1", 7), 0, "Name", "Spindle 1"), 0, "PlaceNumber", 1)
>>> in_spindle(tools, "spindle")
(7, True)
>>> in_spindle(told(tools, 0, "Name", "Chain magazine"), "spindle")
(None, True)
"""

from dataclasses import dataclass, replace
from typing import Any

from edge.sweep import Plain

TOOLS_MAX = 512
_FIELDS = {"ControlIdentifier1": "number", "Name": "place", "PlaceNumber": "place_number"}


@dataclass(frozen=True, slots=True)
class PlacedTool:
    """One tool: which of the list it is, its number, and where it is; None where the control does not say."""

    index: int
    number: int | None = None
    place: str | None = None
    place_number: int | None = None


Tools = tuple[PlacedTool, ...]


def told(tools: Tools, index: int, field: str, value: Plain) -> Tools:
    """The tools after one more value of one of them; a value of another type than it should be is as good as none."""
    known = _FIELDS.get(field)
    if known is None or not 0 <= index < TOOLS_MAX:
        return tools
    fits = isinstance(value, str) if known == "place" else type(value) is int
    before = next((tool for tool in tools if tool.index == index), PlacedTool(index))
    plain: Any = value if fits else None
    after = replace(before, **{known: plain})
    return tuple(sorted((*(tool for tool in tools if tool.index != index), after), key=lambda tool: tool.index))


def in_spindle(tools: Tools, place: str) -> tuple[int | None, bool]:
    """The number of the tool there (None: none is), and whether that can be known at all."""
    there = [tool for tool in tools if _is_at(tool, place)]
    if len(there) > 1 or (there and there[0].number is None):
        return None, False
    if there:
        return there[0].number, True
    return None, any(tool.place is not None or tool.place_number is not None for tool in tools)


def index_in_spindle(tools: Tools, place: str) -> int | None:
    """Return which of the list is there; None where none is, or more than one."""
    there = [tool.index for tool in tools if _is_at(tool, place)]
    return there[0] if len(there) == 1 else None


def _is_at(tool: PlacedTool, place: str) -> bool:
    if place.isdigit():
        return tool.place_number == int(place)
    return tool.place is not None and place.lower() in tool.place.lower()
