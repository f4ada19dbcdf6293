"""A control's state at one time, in typed values: the working day of the simulated machine without its SHDR clothes."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Any

from cnctwin.standins.simulated_machine.as_built import machine_as_built
from cnctwin.standins.simulated_machine.moment import Moment
from cnctwin.standins.simulated_machine.part import spare_part
from cnctwin.standins.simulated_machine.working_day import working_day

AXES = ("x", "y", "z")


@dataclass(frozen=True, slots=True)
class ControlState:
    """One moment. `tool_number` is 0 while no tool is in the spindle; `at_s` counts from the moment the machine was switched on.

    axis_pos_mm, axis_load_pct: of x, y and z
    is_changing_tool: whether a tool change is in progress, the truth that an edge has to find
    alarm: number and text, None where there is none
    """

    at_s: float = 0.0
    exec_state: str = "READY"
    mode: str = "AUTOMATIC"
    program: str = ""
    block: str = ""
    line: int = 0
    tool_number: int = 0
    is_changing_tool: bool = False
    spindle_rpm: float = 0.0
    spindle_load_pct: float = 0.0
    feed_mm_min: float = 0.0
    feed_override_pct: float = 100.0
    rapid_override_pct: float = 100.0
    spindle_override_pct: float = 100.0
    axis_pos_mm: tuple[float, ...] = (0.0, 0.0, 0.0)
    axis_load_pct: tuple[float, ...] = (0.0, 0.0, 0.0)
    spindle_temp_c: float = 0.0
    ambient_temp_c: float = 0.0
    coolant_on: bool = False
    part_count: int = 0
    alarm: tuple[int, str] | None = None


_TEXTS = {"execution": "exec_state", "mode": "mode", "program": "program", "block": "block"}
_WHOLE = {"line": "line", "part_count": "part_count"}
_FIGURES = {
    "Srpm": "spindle_rpm",
    "Sload": "spindle_load_pct",
    "Fact": "feed_mm_min",
    "Fovr": "feed_override_pct",
    "Frapidovr": "rapid_override_pct",
    "Sovr": "spindle_override_pct",
    "Stemp": "spindle_temp_c",
    "room_temp": "ambient_temp_c",
}


def states(moments: Iterable[Moment]) -> Iterator[ControlState]:
    """The states that these moments pass through; one for each moment.

    >>> [state.tool_number for state in states([Moment(0.0, {"Tool_number": "5"}), Moment(1.0, {"Tool_number": ""})])]
    [5, 0]
    """
    state = ControlState()
    for moment in moments:
        state = _after(state, moment)
        yield state


def _after(state: ControlState, moment: Moment) -> ControlState:
    told: dict[str, Any] = {"at_s": moment.at_s}
    for key, text in moment.values.items():
        if key in _TEXTS:
            told[_TEXTS[key]] = text
        elif key in _WHOLE:
            told[_WHOLE[key]] = int(text)
        elif key in _FIGURES:
            told[_FIGURES[key]] = float(text)
        elif key == "Tool_number":
            told["tool_number"] = int(text or 0)
            told["is_changing_tool"] = not text
        elif key == "coolant":
            told["coolant_on"] = text == "ON"
    told["axis_pos_mm"] = _axes(moment, "abs", state.axis_pos_mm)
    told["axis_load_pct"] = _axes(moment, "load", state.axis_load_pct)
    return replace(state, **told)


def _axes(moment: Moment, what: str, before: tuple[float, ...]) -> tuple[float, ...]:
    keys = (f"{axis.upper()}{what}" for axis in AXES)
    return tuple(float(moment.values.get(key, shown)) for key, shown in zip(keys, before, strict=True))


class _AlreadyCut:
    """A part that was computed before, so that a day begins at once and needs no simulation."""

    ready = True

    def __init__(self, *_: object) -> None:
        pass

    @staticmethod
    def result() -> Any:
        return spare_part()


def production_moments(seconds: float) -> Iterator[Moment]:
    """So many seconds of a working day: the same part again and again, five tool changes each, the door open in between."""
    return takewhile(lambda moment: moment.at_s <= seconds, working_day(_AlreadyCut, spare_part, 0.0, machine_as_built()))


def production(seconds: float) -> Iterator[ControlState]:
    """The same as states."""
    return states(production_moments(seconds))


@dataclass(frozen=True, slots=True)
class ToolChange:
    """One true tool change: its times in the machine's own seconds, and the tool that came in."""

    from_s: float
    to_s: float
    tool_number: int


def tool_changes(shown: Iterable[ControlState]) -> list[ToolChange]:
    """The changes that were begun and ended within these states.

    >>> empty, full = ControlState(1.0, tool_number=0, is_changing_tool=True), ControlState(4.0, tool_number=2)
    >>> tool_changes([ControlState(0.0, tool_number=1), empty, full])
    [ToolChange(from_s=1.0, to_s=4.0, tool_number=2)]
    """
    changes: list[ToolChange] = []
    since_s: float | None = None
    for state in shown:
        if state.is_changing_tool and since_s is None:
            since_s = state.at_s
        elif not state.is_changing_tool and since_s is not None:
            changes.append(ToolChange(since_s, state.at_s, state.tool_number))
            since_s = None
    return changes
