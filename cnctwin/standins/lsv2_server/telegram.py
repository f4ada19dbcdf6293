"""LSV2 telegrams on TCP: u32 length of the payload, big-endian, then four characters, then the payload.

>>> encode("R_RI", b"\\x00\\x18").hex(" ")
'00 00 00 02 52 5f 52 49 00 18'
>>> TelegramReader().feed(encode("R_RI", b"\\x00\\x18"))
[Telegram(command='R_RI', payload=b'\\x00\\x18')]
"""

import struct
from typing import NamedTuple

HEADER_BYTES = 8
PAYLOAD_BYTES_MAX = 4096


class TelegramError(Exception):
    """Bytes that are no telegram."""


class Telegram(NamedTuple):
    """One telegram."""

    command: str
    payload: bytes = b""


def encode(command: str, payload: bytes = b"") -> bytes:
    """As bytes."""
    assert len(command) == 4
    return struct.pack("!L", len(payload)) + command.encode("ascii") + payload


class TelegramReader:
    """Telegrams out of the bytes of a stream, however they were cut."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[Telegram]:
        """The telegrams that are whole now; TelegramError where there can be none."""
        rest, found, at = self._rest + data, list[Telegram](), 0
        while len(rest) - at >= HEADER_BYTES:
            (length,) = struct.unpack_from("!L", rest, at)
            if length > PAYLOAD_BYTES_MAX:
                raise TelegramError(f"a telegram of {length} bytes is above the limit of {PAYLOAD_BYTES_MAX}")
            command = rest[at + 4 : at + HEADER_BYTES]
            if not all(32 < byte < 127 for byte in command):
                raise TelegramError(f"{command!r} is no command")
            if len(rest) - at - HEADER_BYTES < length:
                break
            end = at + HEADER_BYTES + length
            found.append(Telegram(command.decode("ascii"), rest[at + HEADER_BYTES : end]))
            at = end
        self._rest = rest[at:]
        return found
