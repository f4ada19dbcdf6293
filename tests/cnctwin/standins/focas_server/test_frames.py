"""The bytes of the protocol, held to those that real controls sent."""

import random
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cnctwin.standins.focas_server import frames
from cnctwin.standins.focas_server.faults import Wrong, spoiled
from cnctwin.standins.focas_server.frames import (
    BODY_BYTES_MAX,
    HEADER_BYTES,
    FrameError,
    FrameType,
    Request,
    answer,
    answer_block,
)
from tests.cnctwin.standins.focas_server import captured
from tests.cnctwin.standins.focas_server.client import blocks, command


def test_captured_requests_are_read() -> None:
    assert frames.header(captured.OPEN[:10]) == (FrameType.OPEN, 2)
    assert frames.requests(captured.SYSINFO[10:]) == [Request(1, 1, 0x18)]
    assert [request.command for request in frames.requests(captured.LOADS[10:])] == [0xA4, 0x89, 0x56, 0xA4]
    positions = frames.requests(captured.NINE[10:])[5:]
    assert [request.arguments[:2] for request in positions] == [(4, -1), (1, -1), (6, -1), (7, -1)]
    assert frames.requests(captured.PMC_D2204[10:]) == [Request(2, 1, 0x8001, (2204, 2205, 9, 1))]


def test_captured_answers_are_what_we_write() -> None:
    axes = Request(1, 1, 0xA4)
    names = answer_block(Request(1, 1, 0x89), b"X\0\0\0Y\0\0\0Z\0\0\0B\0\0\0")
    loads = b"".join(frames.figure(load) for load in (0, -3, 33, *[0] * 29))
    count = answer_block(axes, b"\0\4")
    assert answer([count, names, answer_block(Request(1, 1, 0x56), loads), count]) == captured.LOADS_31I
    assert answer_block(Request(1, 1, 0x25), code=1) == captured.SPINDLE_SPEED_REFUSED_160I
    assert frames.frame(FrameType.CLOSED) == captured.CLOSED_31I


@given(st.binary(max_size=200))
def test_any_bytes_are_a_command_or_refused(body: bytes) -> None:
    try:
        asked = frames.requests(body)
    except FrameError:
        return
    assert len(body) == 2 + sum(28 + len(request.extra) for request in asked)


_requests = st.builds(
    Request,
    st.integers(0, 0xFFFF),
    st.integers(0, 0xFFFF),
    st.integers(0, 0xFFFF),
    st.tuples(*[st.integers(-(2**31), 2**31 - 1)] * 4),
    st.binary(max_size=40),
)


@given(st.lists(_requests, min_size=1, max_size=20))
def test_what_was_asked_is_read(asked: list[Request]) -> None:
    body = struct.pack(">H", len(asked))
    for it in asked:
        length = len(it.extra)
        body += struct.pack(">HHHHiiiiHH", 28 + length, it.device, it.path, it.command, *it.arguments, 0, length) + it.extra
    assert frames.requests(body) == asked


@given(st.binary(min_size=HEADER_BYTES, max_size=HEADER_BYTES))
def test_a_header_is_read_or_refused_before_anything_is_kept(raw: bytes) -> None:
    try:
        _, length = frames.header(raw)
    except FrameError:
        return
    assert length <= BODY_BYTES_MAX


@given(st.floats(allow_nan=False, allow_infinity=False, width=32), st.integers(0, 6))
def test_a_figure_keeps_its_value_or_says_that_it_has_none(value: float, decimals: int) -> None:
    mantissa, base, places = struct.unpack(">iHH", frames.figure(value, decimals))
    if places == 0xFFFF:
        assert abs(value) > 2**31 - 2
    else:
        assert base == 10
        assert mantissa / 10**places == pytest.approx(value, abs=0.51 * 10**-places, rel=1e-6)


WHOLE = answer([answer_block(Request(1, 1, 0x18), bytes(18)), answer_block(Request(1, 1, 0x24), bytes(8))])


@pytest.mark.parametrize("wrong", Wrong)
def test_a_spoiled_answer_is_no_longer_the_answer(wrong: Wrong) -> None:
    chance = random.Random(7)
    for _ in range(20):
        raw = spoiled(WHOLE, wrong, chance)
        assert raw != WHOLE
        says = int.from_bytes(raw[8:10], "big") + 10
        if wrong in (Wrong.TOO_LONG, Wrong.TOO_SHORT, Wrong.GARBAGE):
            assert says != len(raw) or raw[:4] != frames.SYNC
        elif wrong is Wrong.CODES:
            assert all(block.code and not block.data for block in blocks(raw))
        elif wrong is Wrong.SWAPPED:
            assert [block.command for block in blocks(raw)] == [0x24, 0x18]
        elif wrong is Wrong.COMMAND:
            assert [block.command for block in blocks(raw)] == [0x7F7F, 0x24]
        else:
            assert says == len(raw) == len(WHOLE)


def test_the_clients_own_frames_are_the_captured_ones() -> None:
    assert command((1, 0x18)) == captured.SYSINFO
    assert command((1, 0xA4, 2), (1, 0x89), (1, 0x56, 1), (1, 0xA4, 2)) == captured.LOADS
