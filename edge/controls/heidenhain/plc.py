"""Addresses in the PLC memory, as the control's own PLC lists write them.

    M4000  marker          I3, O5   input, output          one byte each, not zero is 1
    B1000  byte            W1000    word (2 bytes)         D1004  double word (4 bytes)      IW, ID, OW, OD likewise
    S2     string

The numbers of B, W and D count bytes of one memory: D1004 lies in the bytes 1004 to 1007, the lowest first. All are signed.
"""

import re
import struct
from typing import Any, NamedTuple

from edge.errors import ConfigError

_ADDRESS = re.compile(r"(M|B|W|D|S|I|O|IW|ID|OW|OD)(\d{1,7})")
_BYTES = {"M": 1, "I": 1, "O": 1, "B": 1, "W": 2, "D": 4, "IW": 2, "ID": 4, "OW": 2, "OD": 4}
_FORMAT = {1: "<b", 2: "<h", 4: "<l"}
_REGION = {"M": "markers", "I": "inputs", "O": "outputs", "S": "strings", "B": "words", "W": "words", "D": "words"}
_REGION |= {"IW": "input_words", "ID": "input_words", "OW": "output_words", "OD": "output_words"}
_BITS = ("M", "I", "O")


class PlcAddress(NamedTuple):
    """One address: what lies there, and its number."""

    kind: str
    number: int

    @classmethod
    def parse(cls, text: str) -> "PlcAddress":
        """Read an address.

        >>> PlcAddress.parse("D26732")
        PlcAddress(kind='D', number=26732)
        """
        found = _ADDRESS.fullmatch(text)
        if found is None:
            raise ConfigError(
                f"{text!r} is no PLC address; write M4000, B1000, W1000, D1004, S2, I3, O5, IW10, ID12, OW10 or OD12"
            )
        address = cls(found[1], int(found[2]))
        size = _BYTES.get(address.kind, 1)
        if address.number % size:
            below = address.number - address.number % size
            raise ConfigError(f"{text!r}: the number of a {address.kind} is a multiple of {size}, such as {address.kind}{below}")
        return address

    def __str__(self) -> str:
        return f"{self.kind}{self.number}"

    def lies_at(self, parameters: Any) -> tuple[int, int] | None:
        """Absolute address and number of bytes, by the system parameters of the control; None where it has no such memory."""
        region = _REGION[self.kind]
        start = int(getattr(parameters, f"{region}_start_address"))
        count = int(getattr(parameters, f"number_of_{region}"))
        if self.kind == "S":
            size = int(parameters.max_string_lenght)
            return (start + self.number * size, size) if 0 <= self.number < count and 0 < size < 256 else None
        size = _BYTES[self.kind]
        room = count if self.kind in _BITS else count * 2
        return (start + self.number, size) if start >= 0 and self.number + size <= room else None

    def value(self, data: bytes) -> bool | int | str:
        """Return what these bytes stand for.

        >>> PlcAddress.parse("W1000").value(bytes([7, 0])), PlcAddress.parse("M1").value(bytes([1]))
        (7, True)
        """
        if self.kind == "S":
            return data.split(b"\x00")[0].decode("latin-1")
        size = _BYTES[self.kind]
        if len(data) != size:
            raise ValueError(f"{len(data)} bytes in place of {size}")
        whole: int = struct.unpack(_FORMAT[size], data)[0]
        return whole != 0 if self.kind in _BITS else whole
