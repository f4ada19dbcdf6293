"""Variables: R parameters of all programs, those that DEF and PROC make in one, and a door to the system variables."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Protocol

from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.language.functions import Value, as_number, as_text, as_whole, checked, round_half_up

R_MAX: Final = 9_999
ELEMENTS_MAX: Final = 10_000
"""Elements of one array, and variables of one program."""
FIRST: Final[Mapping[str, Value]] = {"REAL": 0.0, "INT": 0.0, "BOOL": 0.0, "CHAR": 0.0, "STRING": "", "AXIS": ""}
CONSTANTS: Final[Mapping[str, Value]] = {
    "$PI": math.pi,
    **{"_OFF": 0.0, "_FINISH": 1.0, "_SEMIFIN": 2.0, "_ROUGH": 3.0},
    **{"_ORI_FINISH": 11.0, "_ORI_SEMIFIN": 12.0, "_ORI_ROUGH": 13.0},
}
"""Names that every control has; the modes of CYCLE832 are among them."""


class System(Protocol):
    """The control's own variables, those with $."""

    def read(self, name: str, index: tuple[Value, ...], word: str) -> Value:
        """Value of a system variable."""

    def write(self, name: str, index: tuple[Value, ...], value: Value, word: str) -> None:
        """Set a system variable."""

    def axes(self) -> tuple[str, ...]:
        """Names of the axes in capitals, which may stand as an index."""


@dataclass(slots=True)
class Cell:
    """One variable or array: its type, the sizes, and the values, the last index fastest."""

    kind: str
    sizes: tuple[int, ...]
    values: list[Value]

    def place(self, index: tuple[Value, ...], word: str) -> int:
        """Return where an element lies. RefusedError beside the array."""
        if len(index) != len(self.sizes):
            raise RefusedError(word, f"has {len(self.sizes)} indices, not {len(index)}")
        found = 0
        for one, size in zip(index, self.sizes, strict=True):
            at = as_whole(one, word)
            if not 0 <= at < size:
                raise RefusedError(word, f"its index is {at}; it goes from 0 to {size - 1}")
            found = found * size + at
        return found


def converted(kind: str, value: Value, word: str) -> Value:
    """A value as a variable of that type keeps it: INT rounds, BOOL is 1 for all but 0."""
    if kind in ("STRING", "AXIS"):
        return as_text(value)
    if kind == "CHAR" and isinstance(value, str):
        return float(ord(value[0])) if value else 0.0
    number = checked(as_number(value, word), word)
    if kind == "BOOL":
        return float(number != 0.0)
    return round_half_up(number) if kind in ("INT", "CHAR") else number


class Variables:
    """The variables that expressions of a running program read and assignments write."""

    __slots__ = ("local", "r", "system")

    def __init__(self, parameters: Mapping[str, float], system: System) -> None:
        self.r = {int(name[1:]): float(value) for name, value in parameters.items() if name[0] == "R" and name[1:].isdecimal()}
        self.local: dict[str, Cell] = {}
        self.system = system

    def define(self, kind: str, name: str, sizes: tuple[Value, ...], word: str) -> Cell:
        """Make a variable of the running program. RefusedError where there is one of that name."""
        if name in self.local:
            raise RefusedError(word, "is defined twice")
        counts = tuple(as_whole(size, word) for size in sizes)
        many = math.prod(counts)
        if len(counts) > 3 or any(count < 1 for count in counts) or many > ELEMENTS_MAX or len(self.local) >= ELEMENTS_MAX:
            raise RefusedError(word, f"an array has up to 3 sizes of at least 1, and up to {ELEMENTS_MAX} elements")
        cell = self.local[name] = Cell(kind, counts, [FIRST[kind]] * many)
        return cell

    def read(self, name: str, index: tuple[Value, ...], word: str) -> Value:
        """Value of a variable."""
        if name == "R" and index:
            return self.r.get(self.r_number(index, word), 0.0)
        cell = self.local.get(name)
        if cell is not None:
            return cell.values[cell.place(index, word)]
        if name in CONSTANTS:
            return CONSTANTS[name]
        if name.startswith("$"):
            return self.system.read(name, index, word)
        if name in self.system.axes() and not index:
            return name
        raise RefusedError(word, "this variable is not known; DEF makes one, and global user data are not read")

    def write(self, name: str, index: tuple[Value, ...], value: Value, word: str) -> None:
        """Set a variable."""
        if name == "R" and index:
            self.r[self.r_number(index, word)] = checked(as_number(value, word), word)
            return
        cell = self.local.get(name)
        if cell is not None:
            cell.values[cell.place(index, word)] = converted(cell.kind, value, word)
        elif name.startswith("$"):
            self.system.write(name, index, value, word)
        else:
            raise RefusedError(word, "this variable is not known; DEF makes one, and global user data are not read")

    def fill(self, name: str, index: tuple[Value, ...], values: list[Value], repeated: bool, word: str) -> None:
        """SET(): values into an array from an element on; REP(): over and over to its end."""
        cell = self.local.get(name)
        if cell is None:
            raise RefusedError(word, "SET and REP fill arrays that DEF made")
        at = cell.place(index, word) if index else 0
        many = len(cell.values) - at
        if repeated:
            values = [values[one % len(values)] for one in range(many)]
        elif len(values) > many:
            raise RefusedError(word, f"SET has {len(values)} values, and {many} elements are left")
        for offset, value in enumerate(values):
            cell.values[at + offset] = converted(cell.kind, value, word)

    @staticmethod
    def r_number(index: tuple[Value, ...], word: str) -> int:
        if len(index) != 1:
            raise RefusedError(word, "an R parameter has one number, such as R[5]")
        number = as_whole(index[0], word)
        if not 0 <= number <= R_MAX:
            raise RefusedError(word, f"R parameters are R0 to R{R_MAX}")
        return number
