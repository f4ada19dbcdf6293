"""The arguments of a cycle by the names that the manual gives its parameters."""

import math
from collections.abc import Sequence
from typing import Final

from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.language.functions import Value, as_number

NEWER: Final = ("_UMODE", "_FS", "_ZFS", "_GMODE", "_DMODE", "_AMODE")
"""What newer screens put behind the parameters of a milling cycle. _DMODE is for the screen alone."""


class Arguments:
    """The values of a call. One that is left out is None, and 0 where a number is asked for, as on the control."""

    __slots__ = ("cycle", "unit_mm", "values")

    def __init__(self, cycle: str, names: Sequence[str], given: Sequence[Value | None], unit_mm: float) -> None:
        given = list(given)
        while given and given[-1] is None:
            given.pop()
        if len(given) > len(names):
            raise RefusedError(cycle, f"takes {len(names)} arguments, and the call has {len(given)}")
        self.cycle, self.unit_mm = cycle, unit_mm
        self.values = dict(zip(names, given, strict=False))

    def has(self, name: str) -> bool:
        """Return True where the call gives this argument."""
        return self.values.get(name) is not None

    def number(self, name: str) -> float:
        """The value; 0 where it is left out."""
        value = self.values.get(name)
        figure = 0.0 if value is None else as_number(value, f"{self.cycle} {name}")
        if not math.isfinite(figure):
            raise RefusedError(f"{self.cycle} {name}", "is no number")
        return figure

    def length(self, name: str) -> float:
        """A length, mm."""
        return self.number(name) * self.unit_mm

    def size(self, name: str) -> float:
        """A length that is at least 0, mm."""
        found = self.length(name)
        if found < 0.0:
            raise RefusedError(f"{self.cycle} {name}", f"is {found:g} mm; it is entered without sign")
        return found

    def needed(self, name: str) -> float:
        """A length that is more than 0, mm."""
        found = self.length(name)
        if found <= 0.0:
            raise RefusedError(f"{self.cycle} {name}", "is needed, and more than 0")
        return found

    def whole(self, name: str, low: int, high: int) -> int:
        found = self.number(name)
        if not (found.is_integer() and low <= found <= high):
            raise RefusedError(f"{self.cycle} {name}", f"is {found:g}; it has to be a whole number from {low} to {high}")
        return int(found)

    def only_zero(self, *names: str, reason: str = "is not read; only 0 is") -> None:
        """RefusedError where one of these is given, and not 0."""
        for name in names:
            value = self.values.get(name)
            if value not in (None, 0.0, ""):
                raise RefusedError(f"{self.cycle} {name}", reason)
