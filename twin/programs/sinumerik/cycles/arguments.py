"""The arguments of a cycle by the names that the manual gives its parameters."""

import math
from collections.abc import Sequence
from typing import Final

from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.language.functions import Value, as_number

NEWER: Final = ("_UMODE", "_FS", "_ZFS", "_GMODE", "_DMODE", "_AMODE")
"""The modes that the screens of Operate put behind the parameters of a milling cycle. _DMODE ends in the plane (`in_plane`)."""
OPERATE: Final = (
    "is a mode of Operate's screens that is not read; post this operation without the cycle, or call it as older controls do: "
    "the depth as a coordinate, widths in mm, and 0 here"
)


class Arguments:
    """The values of a call. One that is left out is None, and 0 where a number is asked for, as on the control."""

    __slots__ = ("cycle", "unit_mm", "values")

    def __init__(self, cycle: str, names: Sequence[str], given: Sequence[Value | None], unit_mm: float) -> None:
        given = list(given)
        while given and given[-1] is None:
            given.pop()
        if len(given) > len(names):
            raise RefusedError(
                cycle,
                f"takes {len(names)} arguments, and the call has {len(given)}; one that Operate wrote is not read: "
                "post this operation without the cycle",
            )
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
                figure = f"{value:.12g}" if isinstance(value, float) else str(value)
                raise RefusedError(f"{self.cycle} {name}={figure}", reason)

    def older_form(self, *modes: str) -> None:
        """RefusedError where one of these modes of Operate's screens is not 0. _FS and _ZFS are for chamfering only."""
        self.only_zero(*modes, reason=OPERATE)

    def in_plane(self, plane: int) -> None:
        """RefusedError where the last digit of _DMODE (1, 2, 3: G17, G18, G19) names another plane than that in force."""
        named = self.whole("_DMODE", 0, 999_999_999) % 10
        if named > 3 or named not in (0, plane - 16):
            wanted = f"G{16 + named}" if named <= 3 else "no plane"
            raise RefusedError(
                f"{self.cycle} _DMODE", f"its last digit {named} is {wanted}, and G{plane} is in force; write it before"
            )
