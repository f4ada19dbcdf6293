"""System variables: positions, offsets and data of the tool. Those that a twin cannot know are named.

`$P_EP[X]` end of the last block, `$AA_IW[X]` the same, in the workpiece; `$AA_IM[X]` in the machine; `$P_UIFR[1,X,TR]` settable
offsets (1 = G54, 5 = G505); `$P_TOOLNO`, `$P_TOOL`, `$P_TOOLR`, `$P_TOOLL[1]`; `$P_F`, `$P_S`; `$TC_DP3[t,d]`, `$TC_DP6[t,d]`.
"""

from dataclasses import replace
from typing import Final

from twin.programs.refusal import RefusedError
from twin.programs.settings import ToolOffset
from twin.programs.sinumerik.language.functions import Value, as_number, as_text, as_whole
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.tool import offset, set_length, tool_radius

PLACES: Final = frozenset({"$P_EP", "$AA_IW", "$AA_IM", "$P_EPM"})
COLUMNS: Final = {"$TC_DP3": "length_mm", "$TC_DP6": "radius_mm", "$TC_DP12": "length_wear_mm", "$TC_DP15": "radius_wear_mm"}
FRAME_MAX: Final = 99


class SystemVariables:
    """Reads and writes a state by the names of system variables. Lengths are in programmed units, as on the control."""

    __slots__ = ("state",)

    def __init__(self, state: State) -> None:
        self.state = state

    def axes(self) -> tuple[str, ...]:
        """Names that may stand as an index."""
        return (*(axis.upper() for axis in self.state.axes), "TR", "FI", "RT", "SC", "MI")

    def read(self, name: str, index: tuple[Value, ...], word: str) -> Value:
        """Value of a system variable."""
        state, unit = self.state, self.state.unit_mm
        if name in PLACES and len(index) == 1:
            axis = self.axis(index[0], word)
            in_machine = name in ("$AA_IM", "$P_EPM")
            place = state.position if in_machine else state.frames.to_program(state.position)
            return place[axis] / (unit if axis < 3 else 1.0)
        if name == "$P_UIFR":
            table, axis = self.settable(index, word)
            return table[axis] / (unit if axis < 3 else 1.0)
        if name in COLUMNS:
            row: float = getattr(state.tool_offsets.get(self.tool(index, word), ToolOffset()), COLUMNS[name])
            return row / unit
        if name == "$P_TOOLR" and not index:
            return tool_radius(state, word) / unit
        if name == "$P_TOOLL" and index == (1.0,):
            edge = offset(state, word)
            return (edge.length_mm + edge.length_wear_mm) / unit
        plain: dict[str, float] = {"$P_TOOLNO": state.tool, "$P_TOOL": state.edge, "$P_S": state.speed_word}
        plain |= {
            "$P_F": state.feed_word,
            "$P_PROG_EVENT": 0.0,
            "$P_SEARCH": 0.0,
            "$P_SIM": 0.0,
            "$P_ISTEST": 0.0,
            "$P_DRYRUN": 0.0,
        }
        if name in plain and not index:
            return float(plain[name])
        raise RefusedError(word, "this system variable is not known here")

    def axis(self, value: Value, word: str) -> int:
        name = as_text(value).lower()
        if name not in self.state.axes:
            raise RefusedError(word, f"the machine has no axis {name.upper()}; it has {', '.join(self.state.axes)}")
        return self.state.axes.index(name)

    def settable(self, index: tuple[Value, ...], word: str) -> tuple[list[float], int]:
        """The table and the axis of `$P_UIFR[1,X,TR]`."""
        if len(index) != 3 or index[2] != "TR":
            raise RefusedError(word, "is read as $P_UIFR[1,X,TR] only: the shift of one axis")
        number = as_whole(index[0], word)
        if not 1 <= number <= FRAME_MAX:
            raise RefusedError(word, f"settable offsets are 1 (G54) to {FRAME_MAX} (G599)")
        name = f"G{53 + number}" if number <= 4 else f"G{500 + number}"
        return self.state.frames.offsets(name), self.axis(index[1], word)

    def tool(self, index: tuple[Value, ...], word: str) -> int:
        if len(index) != 2 or index[1] != 1.0:
            raise RefusedError(word, "is read for edge 1 only, such as $TC_DP6[5,1]")
        return as_whole(index[0], word)

    def write(self, name: str, index: tuple[Value, ...], value: Value, word: str) -> None:
        """Set a system variable."""
        state = self.state
        figure = as_number(value, word) * state.unit_mm
        if name == "$P_UIFR":
            table, axis = self.settable(index, word)
            table[axis] = figure if axis < 3 else as_number(value, word)
        elif name in COLUMNS:
            number = self.tool(index, word)
            before = state.tool_offsets.get(number, ToolOffset())
            state.tool_offsets[number] = replace(before, **{COLUMNS[name]: figure})
            if number == state.tool and state.compensation is None:
                set_length(state, word)
        else:
            raise RefusedError(word, "this system variable cannot be set")
