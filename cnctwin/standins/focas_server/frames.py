"""The bytes of FOCAS Ethernet as a control reads and writes them. No I/O, and nothing shared with the edge's own reading.

    frame   = A0 A0 A0 A0 | u16 version | u16 type | u16 length of the body | body            everything big-endian
    command = u16 number of blocks | blocks
    block asked    = u16 its length, 28 + extra | u16 class | u16 path | u16 command | i32 a | i32 b | i32 c | i32 d
                     | u16 auxiliary | u16 length of extra | extra
    block answered = u16 its length, 16 + data | u16 class | u16 path | u16 command | i16 return code | i16 detail | i16 detail
                     | u16 length of data | data

There is no public specification. This follows frames captured on a 160i, a 31i and a 0i (diohpix/pyfanuc, Unlicense:
protocol.txt, sample_multipacket.md, sample_with_error.md) and what is told of the vendor library's checks: a body of at most
3470 bytes.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum

SYNC = b"\xa0\xa0\xa0\xa0"
VERSION = 4  # what a 31i and a 0i-D answer; requests carry 1
HEADER_BYTES = 10
BODY_BYTES_MAX = 3470
ANSWER_BLOCK_BYTES = 16
_HEADER = struct.Struct(">4sHHH")
_ASKED = struct.Struct(">HHHHiiiiHH")
_ANSWERED = struct.Struct(">HHHHhhhH")


class FrameType(IntEnum):
    """The types of frames."""

    OPEN = 0x0101
    OPENED = 0x0102
    OPEN_REFUSED = 0x0103  # every session is in use
    CLOSE = 0x0201
    CLOSED = 0x0202
    COMMAND = 0x2101
    ANSWER = 0x2102


class Code(IntEnum):
    """A control's answer instead of data; the names are the vendor's."""

    OK = 0
    BUSY = -1
    RESET = -2
    FUNC = 1
    LENGTH = 2
    NUMBER = 3
    ATTRIB = 4
    DATA = 5
    NOOPT = 6
    PATH = 11


class FrameError(Exception):
    """Bytes that are no frame; the connection is of no use after them."""


@dataclass(frozen=True, slots=True)
class Request:
    """One block of a command: which function, and its arguments."""

    device: int
    path: int
    command: int
    arguments: tuple[int, int, int, int] = (0, 0, 0, 0)
    extra: bytes = b""


def header(raw: bytes) -> tuple[int, int]:
    """The type of a frame and the length of its body.

    >>> header(bytes.fromhex("a0a0a0a0000101010002")) == (FrameType.OPEN, 2)
    True
    """
    sync, _version, kind, length = _HEADER.unpack(raw)
    if sync != SYNC:
        raise FrameError(f"the frame begins with {sync.hex()}, not a0a0a0a0")
    if length > BODY_BYTES_MAX:
        raise FrameError(f"a body of {length} bytes is above the limit of {BODY_BYTES_MAX}")
    return kind, length


def requests(body: bytes) -> list[Request]:
    """The blocks of a command's body; there is at least one, and nothing is left over."""
    if len(body) < 2:
        raise FrameError(f"a command of {len(body)} bytes has no number of blocks")
    number, at = int.from_bytes(body[:2], "big"), 2
    found: list[Request] = []
    for _ in range(number):
        if len(body) - at < _ASKED.size:
            raise FrameError(f"block {len(found) + 1} of {number} is cut off")
        length, device, path, command, a, b, c, d, _aux, extra = _ASKED.unpack_from(body, at)
        if length != _ASKED.size + extra or at + length > len(body):
            raise FrameError(f"block {len(found) + 1} of {number} says {length} bytes with {extra} bytes of extra data")
        found.append(Request(device, path, command, (a, b, c, d), body[at + _ASKED.size : at + length]))
        at += length
    if not found or at != len(body):
        raise FrameError(f"{number} blocks leave {len(body) - at} bytes over")
    return found


def frame(kind: int, body: bytes = b"") -> bytes:
    """A frame of the control.

    >>> frame(FrameType.CLOSED).hex()
    'a0a0a0a0000402020000'
    """
    return _HEADER.pack(SYNC, VERSION, kind, len(body)) + body


def answer_block(request: Request, data: bytes = b"", code: int = Code.OK) -> bytes:
    """The answer to one block.

    >>> answer_block(Request(1, 1, 0x25), code=Code.FUNC).hex()
    '00100001000100250001000000000000'
    """
    length = ANSWER_BLOCK_BYTES + len(data)
    return _ANSWERED.pack(length, request.device, request.path, request.command, code, 0, 0, len(data)) + data


def answer(blocks: list[bytes]) -> bytes:
    """The frame that answers a command."""
    return frame(FrameType.ANSWER, len(blocks).to_bytes(2, "big") + b"".join(blocks))


def figure(value: float | None, decimals: int = 0) -> bytes:
    """A number as a control sends it: mantissa, base 10 and decimals; None is the mark of "no value".

    >>> figure(-2.88, 3).hex(), figure(None).hex()
    ('fffff4c0000a0003', 'ffffffff000affff')
    """
    while value is not None:
        mantissa = round(value * 10**decimals)
        if -(2**31) <= mantissa < 2**31:
            return struct.pack(">iHH", mantissa, 10, decimals)
        if decimals == 0:
            break
        decimals -= 1
    return bytes.fromhex("ffffffff000affff")
