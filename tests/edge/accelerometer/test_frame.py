"""The framing of acceleration blocks: round trips, pieces, and everything that is no frame."""

import struct
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge.accelerometer.frame import HEADER, SAMPLES_MAX, Block, Frames, encode
from edge.errors import DocumentError

BLOCK = Block(7, 10_000.0, 1_700_000_000_000_000, (0.5, -0.25, 1.0))
floats = st.floats(width=32, allow_nan=False)
blocks = st.builds(
    Block,
    number=st.integers(0, 2**64 - 1),
    rate_hz=st.floats(1.0, 200_000.0),
    last_us=st.one_of(st.none(), st.integers(1, 2**64 - 1)),
    samples_g=st.lists(floats, min_size=1, max_size=50).map(tuple),
)


@given(sent=st.lists(blocks, max_size=4), cut=st.integers(1, 60))
def test_what_is_sent_comes_out_however_the_network_cuts_it(sent: list[Block], cut: int) -> None:
    wire, frames = b"".join(map(encode, sent)), Frames()
    got = [block for at in range(0, len(wire), cut) for block in frames.feed(wire[at : at + cut])]
    assert got == sent
    assert frames.is_between


def test_counts_times_the_scale_are_g() -> None:
    (got,) = Frames().feed(encode(BLOCK, scale_g=0.0005))
    assert got.samples_g == pytest.approx(BLOCK.samples_g, abs=0.00025)
    assert got[:3] == BLOCK[:3]


@given(place=st.integers(0, 55), bit=st.integers(0, 7))
def test_no_value_comes_of_a_frame_with_a_flipped_bit(place: int, bit: int) -> None:
    wire = bytearray(encode(BLOCK))
    wire[place] ^= 1 << bit
    try:
        got = list(Frames().feed(bytes(wire)))
    except DocumentError:
        return
    assert got == []  # a length that grew waits for more


@given(data=st.binary(max_size=300))
def test_bytes_never_crash_it(data: bytes) -> None:
    for wire in (data, b"ACB1" + data, encode(BLOCK)[:44] + data):
        frames = Frames()
        try:
            got = list(frames.feed(wire))
        except DocumentError:
            continue
        assert all(isinstance(block, Block) for block in got)


def frame(**fields: object) -> bytes:
    """A header with a wrong field; its CRC is that of nothing."""
    names = ("magic", "header_bytes", "kind", "spare", "count", "number", "last_us", "rate_hz", "scale_g", "checksum")
    right = dict(zip(names, HEADER.unpack(encode(BLOCK)[: HEADER.size]), strict=True))
    return HEADER.pack(*(right | fields).values())


@pytest.mark.parametrize(
    ("wire", "words"),
    [
        (b"GET / HTTP/1.1", "it begins with b'GET ' in place of b'ACB1'"),
        (frame(header_bytes=43), "a header of 43 bytes is outside 44 to 256"),
        (frame(header_bytes=65_535), "a header of 65535 bytes is outside 44 to 256"),
        (frame(kind=3), "samples of type 3; known are 1"),
        (frame(count=0), f"a block of 0 samples is outside 1 to {SAMPLES_MAX}"),
        (frame(count=2**32 - 1), f"a block of 4294967295 samples is outside 1 to {SAMPLES_MAX}"),
        (frame(checksum=1) + encode(BLOCK)[44:], "block 7: its CRC does not fit"),
        (encode(BLOCK._replace(rate_hz=1e9)), "a sample rate of 1e+09 Hz is outside"),
        (encode(BLOCK._replace(rate_hz=float("nan"))), "a sample rate of nan Hz is outside"),
        (encode(BLOCK._replace(samples_g=(0.0,)), scale_g=-1.0), "a scale of -1 g a count is no scale"),
    ],
)
def test_what_is_no_frame_is_refused_with_the_culprit(wire: bytes, words: str) -> None:
    with pytest.raises(DocumentError, match=words.replace("(", r"\(").replace("+", r"\+")):
        list(Frames().feed(wire))


def test_a_longer_header_of_a_later_sender_is_left_unread() -> None:
    """The bytes past the 44th belong to what the CRC covers after the header."""
    short = encode(BLOCK)
    head = bytearray(short[:44])
    struct.pack_into("<H", head, 4, 52)
    struct.pack_into("<I", head, 40, zlib.crc32(short[44:], zlib.crc32(bytes(head[:40]))))
    (got,) = Frames().feed(bytes(head) + b"more of " + short[44:])
    assert got == BLOCK
