"""Blocks of acceleration on a wire or in a file: a small framing of our own, since there is no common one.

All numbers are little-endian. A frame is a header, then `count` samples:

    offset  type     field
     0      4 bytes  magic "ACB1" (acceleration block, version 1)
     4      u16      length of the header, 44 to 256; bytes past 44 are left unread
     6      u8       type of a sample: 1 = float32, in g; 2 = int16, times `scale_g`
     7      u8       0
     8      u32      count of samples, 1 to 100 000
    12      u64      number of the block, one more each time: a number that is left out is a lost block
    20      u64      time of the LAST sample, microseconds since 1970 by the sender's clock; 0 = it has none
    28      f64      sample rate in Hz
    36      f32      scale_g: g for one count of int16; 1 for float32
    40      u32      CRC-32 of bytes 0 to 39 and of the samples

A sender just writes frames, one after the other, over TCP; nothing is asked or answered. Bytes that are no frame, and a CRC that
does not fit, end the connection: what follows them cannot be trusted to begin anywhere.
"""

import array
import math
import struct
import sys
import zlib
from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple

from edge.errors import DocumentError

MAGIC = b"ACB1"
HEADER = struct.Struct("<4sHBBIQQdfI")
HEADER_BYTES_MAX = 256
SAMPLES_MAX = 100_000
RATE_HZ_MAX = 200_000.0


class SampleType(IntEnum):
    """The encoding of a sample."""

    FLOAT32 = 1
    INT16 = 2


TYPECODES = {SampleType.FLOAT32: "f", SampleType.INT16: "h"}


class Block(NamedTuple):
    """Samples in g. `last_us`: time of the last of them by the source's clock; None where it has none."""

    number: int
    rate_hz: float
    last_us: int | None
    samples_g: tuple[float, ...]


def encode(block: Block, scale_g: float | None = None) -> bytes:
    """A frame; with a `scale_g` its samples are int16.

    >>> len(encode(Block(7, 10_000.0, 1_700_000_000_000_000, (0.0, 1.0)), scale_g=0.001))
    48
    """
    samples: array.array[float] | array.array[int] = array.array("f", block.samples_g)
    kind = SampleType.FLOAT32 if scale_g is None else SampleType.INT16
    if scale_g is not None:
        samples = array.array("h", [round(value / scale_g) for value in block.samples_g])
    if sys.byteorder == "big":
        samples.byteswap()
    body = samples.tobytes()
    head = MAGIC, HEADER.size, kind, 0, len(block.samples_g), block.number, block.last_us or 0, block.rate_hz, scale_g or 1.0
    checksum = zlib.crc32(body, zlib.crc32(HEADER.pack(*head, 0)[:-4]))
    return HEADER.pack(*head, checksum) + body


class Frames:
    """Frames out of bytes, as they come."""

    def __init__(self) -> None:
        self._waiting = bytearray()

    def feed(self, data: bytes) -> Iterator[Block]:
        """The blocks that are whole now; DocumentError at bytes that are no frame."""
        self._waiting += data
        while (need := self._need()) <= len(self._waiting) and need:
            frame = bytes(self._waiting[:need])
            del self._waiting[:need]
            yield _block(frame)

    @property
    def is_between(self) -> bool:
        """Return whether no part of a frame waits."""
        return not self._waiting

    def _need(self) -> int:
        """Return how many bytes the frame has that begins here; 0 while its header is not whole."""
        if self._waiting[: len(MAGIC)] != MAGIC[: len(self._waiting)]:
            raise DocumentError(
                f"no frame of an accelerometer: it begins with {bytes(self._waiting[:4])!r} in place of {MAGIC!r}"
            )
        if len(self._waiting) < HEADER.size:
            return 0
        _, header_bytes, kind, _, count, *_ = HEADER.unpack_from(self._waiting)
        if not HEADER.size <= header_bytes <= HEADER_BYTES_MAX:
            raise DocumentError(f"a header of {header_bytes} bytes is outside {HEADER.size} to {HEADER_BYTES_MAX}")
        if kind not in TYPECODES:
            raise DocumentError(f"samples of type {kind}; known are 1 (float32) and 2 (int16)")
        if not 1 <= count <= SAMPLES_MAX:
            raise DocumentError(f"a block of {count} samples is outside 1 to {SAMPLES_MAX}")
        return int(header_bytes + count * array.array(TYPECODES[SampleType(kind)]).itemsize)


def _block(frame: bytes) -> Block:
    _, header_bytes, kind, _, _, number, last_us, rate_hz, scale_g, checksum = HEADER.unpack_from(frame)
    body = frame[header_bytes:]
    if zlib.crc32(body, zlib.crc32(frame[: HEADER.size - 4])) != checksum:
        raise DocumentError(f"block {number}: its CRC does not fit")
    if not 0.0 < rate_hz <= RATE_HZ_MAX:
        raise DocumentError(f"block {number}: a sample rate of {rate_hz:g} Hz is outside 0 to {RATE_HZ_MAX:g}")
    samples = array.array(TYPECODES[SampleType(kind)])
    samples.frombytes(body)
    if sys.byteorder == "big":
        samples.byteswap()
    if kind == SampleType.FLOAT32:
        return Block(number, rate_hz, last_us or None, tuple(samples))
    if not (math.isfinite(scale_g) and scale_g > 0.0):
        raise DocumentError(f"block {number}: a scale of {scale_g:g} g a count is no scale")
    return Block(number, rate_hz, last_us or None, tuple([value * scale_g for value in samples]))
