"""System variables: #2000s and #10000s offsets, #3000s alarm and clocks, #4000s modes, #5000s positions and work offsets.

What a twin cannot know (the date #3011, the time #3012) is an error, unless `Settings.variables` gives it. The clocks #3001 and
#3002 stand still at what was written to them, since the interpreter knows no time.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from twin.programs.canonical import ProgramStop
from twin.programs.fanuc.state import State
from twin.programs.fanuc.tool_table import change_tool, set_length
from twin.programs.refusal import RefusedError
from twin.programs.settings import ToolOffset

if TYPE_CHECKING:
    from twin.programs.fanuc.flow import Flow

MODES: Final = (
    *("motion", "plane", "distance", None, "feed", "units", "cutter", "length", "cycle", "retract"),
    *("scaling", "macro", "speed", "work", "path", "rotation", "polar"),
)
"""#4001 to #4017, by the group of modal codes."""
TOOL_COLUMNS: Final = (
    (10001, 400, "length_wear_mm"),
    (11001, 400, "length_mm"),
    (12001, 400, "radius_wear_mm"),
    (13001, 400, "radius_mm"),
    (2001, 200, "length_wear_mm"),
    (2201, 200, "length_mm"),
)
"""First variable, how many, and the column of the offset table (memory C)."""
KEPT: Final = frozenset({3001, 3002, 3003, 3004, 3005, 3007, 3901, 3902})
"""Clocks, switches and counters: they hold what was written, 0 at first."""


class SystemVariables:
    """Reads and writes a state by the numbers of system variables. Lengths are in programmed units, as on the control."""

    __slots__ = ("flow", "kept", "state")

    def __init__(self, state: State, initial: Mapping[int, float]) -> None:
        self.state = state
        self.flow: Flow | None = None
        self.kept: dict[int, float] = {number: float(value) for number, value in initial.items() if number >= 1000}

    def read(self, number: int) -> float | None:
        """Value of #number."""
        place = self.place(number)
        if place is not None:
            return self.in_units(place[0][place[1]])
        for first, many, column in TOOL_COLUMNS:
            if first <= number < first + many:
                value: float = getattr(self.state.tool_offsets.get(number - first + 1, ToolOffset()), column)
                return self.in_units(value)
        if number in self.kept or number in KEPT:
            return self.kept.get(number, 0.0)
        if 4001 <= number <= 4130:
            return self.mode(number)
        if 5001 <= number <= 5089:
            return self.position(number)
        raise RefusedError(f"#{number}", "this system variable is not known here; [control] variables may give its value")

    def in_units(self, value: float) -> float:
        return value / self.state.unit_mm

    def place(self, number: int) -> tuple[list[float], int] | None:
        """The work offset that a variable stands for: its table and axis."""
        coordinates, axes = self.state.coordinates, len(self.state.axes)
        row = column = -1
        if 5201 <= number <= 5329:
            row, column = divmod(number - 5201, 20)
        elif 7001 <= number <= 7001 + 48 * 20:
            row, column = divmod(number - 7001, 20)
            row += 7
        elif number >= 2500 and number < 2500 + 100 * axes and (number - 2500) % 100 <= 6:
            column, row = divmod(number - 2500, 100)
        if row < 0 or not 0 <= column < axes or row > 54:
            return None
        if row == 0:
            return coordinates.external, column
        return coordinates.offsets(f"G{53 + row}" if row <= 6 else f"G54.1 P{row - 6}"), column

    def mode(self, number: int) -> float:
        """#4001…: the G code in force of each group; #41xx: the last word of a letter."""
        state = self.state
        if number - 4001 < len(MODES):
            name = MODES[number - 4001]
            return getattr(state.modal, name) / 10.0 if name is not None else 0.0
        values: dict[int, float] = {
            4107: state.radius_number or 0,
            4109: state.feed_word if state.modal.feed == 930 else self.in_units(state.feed_word),
            4111: state.length_number or 0,
            4119: state.speed_word,
            4120: state.preselected if state.preselected is not None else 0,
        }
        if number in values:
            return float(values[number])
        if number == 4115 and self.flow is not None:
            return float(self.flow.level.section.number or 0)
        if number == 4130:
            name_of_work = state.coordinates.work_name
            return float(name_of_work.split("P")[1]) if "P" in name_of_work else 0.0
        raise RefusedError(
            f"#{number}", "this mode is not kept here; use #4001-#4017, #4107, #4109, #4111, #4115, #4119, #4120, #4130"
        )

    def position(self, number: int) -> float:
        """#5001 end of the last block, #5021 machine, #5041 work, #5061 skip, #5081 tool length; without cutter compensation."""
        state = self.state
        row, axis = divmod(number - 5001, 20)
        if axis >= len(state.axes):
            raise RefusedError(f"#{number}", f"the machine has {len(state.axes)} axes")
        values = (
            state.coordinates.to_program(state.position),
            state.position,
            state.coordinates.to_program(state.position),
            state.coordinates.to_program(state.skip_position),
            tuple(state.coordinates.tool),
        )[row]
        return values[axis] if state.axes[axis] in "abc" else self.in_units(values[axis])

    def write(self, number: int, value: float | None) -> None:
        """Set #number. #3000 is an alarm, and so an error; #3006 a stop."""
        given, state = value or 0.0, self.state
        if number == 3000:
            raise RefusedError("#3000", f"the program raises its own alarm {given:g}")
        if number == 3006:
            state.emit(ProgramStop(state.line, False, state.program))
            return
        if number in KEPT:
            self.kept[number] = given
            return
        place = self.place(number)
        if place is not None:
            place[0][place[1]] = given * state.unit_mm
            state.coordinates.refresh()
            return
        for first, many, column in TOOL_COLUMNS:
            if first <= number < first + many:
                change_tool(state, number - first + 1, column, given * state.unit_mm)
                set_length(state, "")
                return
        raise RefusedError(f"#{number}", "this system variable cannot be set")
