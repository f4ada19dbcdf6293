"""The parameters of a program: Q and QR of all programs, QL of each, and those that the control itself fills (Q108 to Q114)."""

import math
from collections.abc import Callable, Mapping
from typing import Final

from twin.programs.refusal import RefusedError

LIMITS: Final[Mapping[str, int]] = {"Q": 1999, "QL": 499, "QR": 499}


class Variables:
    """The parameters that formulas read and assignments write.

    read_system: value of Q108 … Q114 as the control fills it; None for any other
    """

    __slots__ = ("common", "local", "read_system")

    def __init__(self, initial: Mapping[str, float], read_system: Callable[[int], float | None]) -> None:
        self.common: dict[tuple[str, int], float] = {}
        self.local: dict[int, float] = {}
        self.read_system = read_system
        for name, number in initial.items():
            kind = name.rstrip("0123456789")
            if kind in LIMITS:
                self.write(kind, int(name[len(kind) :]), float(number))

    def defined(self, kind: str, number: int) -> bool:
        """Return True where the parameter has a value."""
        if kind == "QL":
            return number in self.local
        return (kind, number) in self.common or (kind == "Q" and self.read_system(number) is not None)

    def read(self, kind: str, number: int) -> float:
        """Value of a parameter; RefusedError where it has none: the twin invents no value."""
        found = self.local.get(number) if kind == "QL" else self.common.get((kind, number))
        if found is None and kind == "Q":
            found = self.read_system(number)
        if found is None:
            raise RefusedError(f"{kind}{number}", "has no value yet; set it before, or in [control] parameters")
        return found

    def write(self, kind: str, number: int, value: float) -> None:
        """Set a parameter."""
        if kind not in LIMITS or number > LIMITS[kind]:
            raise RefusedError(f"{kind}{number}", "there is no such parameter; use Q0-Q1999, QL0-QL499, QR0-QR499")
        if not math.isfinite(value):
            raise RefusedError(f"{kind}{number}", "the result is too large")
        if kind == "QL":
            self.local[number] = value
        else:
            self.common[(kind, number)] = value
