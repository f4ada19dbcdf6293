"""Addresses of the PMC, the control's own PLC.

`R100.3` is bit 3 of byte 100 of area R, `D100:2` the two bytes from D100 on, `D100:2s` the same with a sign.
"""

import re
from typing import NamedTuple

from edge.errors import ConfigError

# The number of each area in pmc_rdpmcrng.
AREAS = {"G": 0, "F": 1, "Y": 2, "X": 3, "A": 4, "R": 5, "T": 6, "K": 7, "C": 8, "D": 9, "E": 12}
_ADDRESS = re.compile(r"([GFYXARTKCDE])(\d{1,5})(?:\.([0-7])|:([124])(S?))?")


class PmcAddress(NamedTuple):
    """A byte, one bit of it, or several bytes, of which the first is the lowest."""

    area: str
    byte: int
    bit: int | None = None
    width: int = 1
    is_signed: bool = False

    @property
    def byte_name(self) -> str:
        """The byte without the bit."""
        return f"{self.area}{self.byte}"


def pmc_address(text: str) -> PmcAddress:
    """The address that a text names.

    >>> pmc_address("R100.3")
    PmcAddress(area='R', byte=100, bit=3, width=1, is_signed=False)
    """
    match = _ADDRESS.fullmatch(text.upper())
    if match is None:
        areas = "".join(AREAS)
        raise ConfigError(
            f"{text!r} is no PMC address; write R100, R100.3, D100:2 or D100:2s: one of {areas}, the byte, then bit or width"
        )
    area, byte, bit, width, sign = match.groups()
    return PmcAddress(area, int(byte), None if bit is None else int(bit), int(width or 1), bool(sign))
