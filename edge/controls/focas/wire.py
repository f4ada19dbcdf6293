"""Frames of the protocol that FANUC's library speaks on TCP port 8193, as public captures show it; all figures are big-endian.

    frame    A0A0A0A0 | u16 version | u16 type | u16 length | body
    open     0101, body 0002 → 0102, or 0103 where no session is free; close 0201 → 0202
    ask      2101: u16 count, then blocks of 28 bytes: u16 28 | u16 device | u16 path | u16 command | 4 × i32 | u16 0 | u16 0
    answer   2102: u16 count, then u16 length | device | path | command | i16 status | 2 × i16 detail | u16 length | data
    refusal  2103 in place of the answer: count 0 and a code
    value    i32 mantissa | u16 base | i16 exponent: mantissa / base^exponent; FFFF as exponent is no value

FANUC has not published it. The sources are the notes and captures of pyfanuc (https://github.com/diohpix/pyfanuc, Unlicense) and
captures of others; what is known from captures and what is not is said in docs/how-to/edge-focas.md.
"""

import struct
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from edge.errors import DocumentError

MAGIC = b"\xa0\xa0\xa0\xa0"
HEADER_BYTES = 10
BODY_BYTES_MAX = 8192
BLOCKS_MAX = 64
CNC, PMC = 1, 2
OPEN, OPENED, REFUSED = 0x0101, 0x0102, 0x0103
CLOSE, CLOSED = 0x0201, 0x0202
ASK, ANSWER, ANSWER_REFUSED = 0x2101, 0x2102, 0x2103
DECIMALS_MAX = 9
_REQUEST = struct.Struct(">HHHH4iHH")
_REPLY = struct.Struct(">HHHHhhhH")
_VALUE = struct.Struct(">iHh")


class Block(NamedTuple):
    """One command of a request."""

    command: int
    arguments: tuple[int, ...] = ()
    device: int = CNC


class Header(NamedTuple):
    """The first ten bytes."""

    version: int
    type: int
    length: int


class Reply(NamedTuple):
    """One block of an answer. `status` is a return code; other than 0 there is no data."""

    status: int
    data: bytes


def frame(type_: int, body: bytes = b"") -> bytes:
    """A frame of ours.

    >>> frame(CLOSE).hex()
    'a0a0a0a0000102010000'
    """
    return MAGIC + struct.pack(">HHH", 1, type_, len(body)) + body


def request(blocks: Sequence[Block], path: int = 1) -> bytes:
    """The frame that asks all of these at once.

    >>> request([Block(0x18)]).hex()
    'a0a0a0a000012101001e0001001c0001000100180000000000000000000000000000000000000000'
    """
    packed = (
        _REQUEST.pack(_REQUEST.size, b.device, path, b.command, *b.arguments, *(0,) * (4 - len(b.arguments)), 0, 0)
        for b in blocks
    )
    return frame(ASK, struct.pack(">H", len(blocks)) + b"".join(packed))


def header(raw: bytes) -> Header:
    """Read the first ten bytes; DocumentError where they are no header, or announce too much."""
    if len(raw) != HEADER_BYTES or raw[:4] != MAGIC:
        raise DocumentError(f"no frame of FOCAS: it begins with {raw[:10].hex() or 'nothing'}")
    head = Header(*struct.unpack(">HHH", raw[4:]))
    if head.length > BODY_BYTES_MAX:
        raise DocumentError(f"a frame of {head.length} bytes is above the limit of {BODY_BYTES_MAX}")
    return head


def replies(blocks: Sequence[Block], body: bytes, path: int = 1) -> tuple[Reply, ...]:
    """The blocks of an answer, each to the command that was asked; DocumentError where they are not.

    >>> replies([Block(0x1D)], bytes.fromhex("000100140001000100" "1d0000000000000004" "00000007"))
    (Reply(status=0, data=b'\\x00\\x00\\x00\\x07'),)
    """
    count = int.from_bytes(body[:2], "big")
    if len(body) < 2 or count != len(blocks):
        raise DocumentError(f"an answer of {count} blocks to {len(blocks)} questions")
    found, at = list[Reply](), 2
    for asked in blocks:
        length = int.from_bytes(body[at : at + 2], "big")
        block = body[at : at + length]
        if length < _REPLY.size or len(block) != length:
            raise DocumentError(f"a block of {length} bytes, {len(block)} of them there")
        _, device, answered_path, command, status, _, _, data_length = _REPLY.unpack_from(block)
        data = block[_REPLY.size :]
        if (device, command) != (asked.device, asked.command) or answered_path != path:
            raise DocumentError(f"an answer to command {command:#x} of path {answered_path}; asked was {asked.command:#x}")
        if status == 0 and data_length > len(data):
            raise DocumentError(f"data of {data_length} bytes, {len(data)} of them there")
        found.append(Reply(status, data[:data_length] if status == 0 else b""))
        at += length
    if at != len(body):
        raise DocumentError(f"{len(body) - at} bytes after the last block")
    return tuple(found)


def refusal(body: bytes) -> int:
    """The code in a frame that refuses the whole request (seen: count 0, then -17, for a number that does not exist)."""
    return int.from_bytes(body[2:4], "big", signed=True) if len(body) >= 4 else 0


def value(data: bytes) -> float | int | None:
    """A value of 8 bytes, or None where the control says that it has none; DocumentError where it is no value.

    >>> [value(bytes.fromhex(row)) for row in ("fffdb0bd000a0004", "00000dac000a0000", "ffffffff000affff")]
    [-15.1363, 3500, None]
    """
    if len(data) != _VALUE.size:
        raise DocumentError(f"a value of {len(data)} bytes")
    mantissa, base, exponent = _VALUE.unpack(data)
    if exponent == -1:
        return None
    if base not in (2, 10) or not 0 <= exponent <= DECIMALS_MAX:
        raise DocumentError(f"a value to the base {base} with exponent {exponent}")
    return mantissa if exponent == 0 else float(mantissa) / float(base**exponent)


def values(data: bytes, count: int) -> tuple[float | int | None, ...]:
    """The first `count` values of a row; what is behind them is of axes that the control does not have."""
    if len(data) < count * _VALUE.size:
        raise DocumentError(f"{len(data)} bytes hold no {count} values")
    return tuple(value(data[at * _VALUE.size : (at + 1) * _VALUE.size]) for at in range(count))


def text(data: bytes) -> str:
    """Text up to the first NUL. Controls send ASCII, and in comments their own code page, which is not told here."""
    return data.split(b"\0", 1)[0].decode("ascii", errors="replace").strip()


def names(data: bytes, count: int) -> Iterable[str]:
    """Names of four bytes, of which the first is the letter and the second a digit, where an axis has one."""
    for at in range(0, min(len(data), 4 * count), 4):
        yield "".join(chr(c) for c in data[at : at + 2] if 33 <= c < 127)
