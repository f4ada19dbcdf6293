"""The frames of the Ethernet protocol, on captures of real controls and beside pyfocas."""

import struct
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyfocas.protocol import packet

from edge.controls.focas import wire
from edge.controls.focas.wire import Block, Reply
from edge.errors import DocumentError
from tests.edge.controls.focas import captured_frames as captured

MULTI = (Block(0xA4, (2,)), Block(0x89), Block(0x56, (1,)), Block(0xA4, (2,)))
ERRORS = (
    *(Block(command) for command in (0x1A, 0x1C, 0x1D, 0x24, 0x25)),
    *(Block(0x26, (kind, -1)) for kind in (4, 1, 6, 7)),
)
DIAGNOSIS = (Block(0x30, (918, 918, 1)),)


def read(blocks: Sequence[Block], text: str) -> tuple[Reply, ...]:
    raw = bytes.fromhex(text)
    head = wire.header(raw[:10])
    assert (head.type, head.length) == (wire.ANSWER, len(raw) - 10)
    return wire.replies(blocks, raw[10:])


@pytest.mark.parametrize(
    ("blocks", "asked"),
    [
        (MULTI, captured.MULTI_ASKED),
        (ERRORS, captured.ERRORS_ASKED),
        (DIAGNOSIS, captured.DIAGNOSIS_ASKED),
        ((Block(0x18),), captured.SYSTEM_ASKED),
    ],
)
def test_requests_are_those_that_a_real_library_sent(blocks: Sequence[Block], asked: str) -> None:
    assert wire.request(blocks).hex() == asked


def test_an_answer_of_a_real_control_to_several_questions() -> None:
    count, names, loads, again = read(MULTI, captured.MULTI_ANSWERED)
    assert (count.data, again.data) == (b"\0\4", b"\0\4")
    assert list(wire.names(names.data, 4)) == ["X", "Y", "Z", "B"]
    assert wire.values(loads.data, 4) == (0, -3, 33, 0)


def test_a_real_control_refuses_single_functions() -> None:
    alarm, programs, sequence, feed, spindle, absolute, machine, relative, to_go = read(ERRORS, captured.ERRORS_ANSWERED)
    assert (spindle, to_go) == (Reply(1, b""), Reply(6, b""))
    assert (int.from_bytes(alarm.data, "big"), struct.unpack(">ii", programs.data), sequence.data) == (0, (3000, 3000), bytes(4))
    assert wire.value(feed.data) == 0.0
    assert wire.values(machine.data, 6) == (-15.1363, -122.4431, -0.2131, -0.0099, -125.0, 328.7623)
    assert wire.values(absolute.data, 2) == (311.1657, 17.9202)
    assert wire.values(relative.data, 6)[5] == -46814.2578


def test_a_diagnosis_of_a_real_control() -> None:
    (reply,) = read(DIAGNOSIS, captured.DIAGNOSIS_ANSWERED)
    assert struct.unpack(">ihhi", reply.data[:12]) == (918, 0, 2, 1536675)


def test_the_session_of_a_real_control() -> None:
    head = wire.header(bytes.fromhex(captured.OPENED)[:10])
    assert head == (4, wire.OPENED, 0x168)
    (system,) = read((Block(0x18),), captured.SYSTEM_ANSWERED)
    assert system.data == bytes.fromhex("04020020") + b" 0 MD5F311.002"


def test_pyfocas_sends_the_same_and_reads_the_same() -> None:
    body = struct.pack(">HHH5i", 1, 1, 0x18, 0, 0, 0, 0, 0)
    ours = wire.request([Block(0x18)])
    assert packet.create_packet(packet.PacketOrigin.CLIENT, packet.PacketType.GENERIC_REQUEST, body) == ours
    assert packet.create_packet(packet.PacketOrigin.CLIENT, packet.PacketType.CLOSE_REQUEST, b"") == wire.frame(wire.CLOSE)
    theirs = packet.extract_focas_packet(bytes.fromhex(captured.MULTI_ANSWERED))
    assert isinstance(theirs.data, list)
    assert [data[14:] for data in theirs.data] == [reply.data for reply in read(MULTI, captured.MULTI_ANSWERED)]


@given(st.integers(-(2**31), 2**31 - 1), st.sampled_from([2, 10]), st.integers(0, 9))
def test_a_value_is_that_which_pyfocas_reads(mantissa: int, base: int, exponent: int) -> None:
    raw = struct.pack(">iHh", mantissa, base, exponent)
    assert wire.value(raw) == pytest.approx(packet.decode_scaled_integer(raw), rel=1e-15)


def test_a_value_that_is_none_or_no_value() -> None:
    assert wire.value(bytes.fromhex("ffffffff000affff")) is None
    for raw in ("0000000100030000", "00000001000a000a", "00000001000a8000", "00000001000a00"):
        with pytest.raises(DocumentError):
            wire.value(bytes.fromhex(raw))


blocks_asked = st.lists(
    st.builds(Block, st.integers(0, 0xFFFF), st.just(()), st.sampled_from([wire.CNC, wire.PMC])), min_size=1, max_size=6
)


def answered(blocks: Sequence[Block], rows: Sequence[tuple[int, bytes]]) -> bytes:
    packed = (
        struct.pack(">HHHHhhhH", 16 + len(data), block.device, 1, block.command, status, 0, 0, len(data)) + data
        for block, (status, data) in zip(blocks, rows, strict=True)
    )
    return struct.pack(">H", len(blocks)) + b"".join(packed)


@given(blocks_asked, st.data())
def test_each_answer_is_read_as_it_was_written_and_a_torn_one_is_refused(blocks: list[Block], data: st.DataObject) -> None:
    rows = data.draw(
        st.lists(
            st.tuples(st.just(0), st.binary(max_size=40)) | st.tuples(st.integers(1, 17), st.just(b"")),
            min_size=len(blocks),
            max_size=len(blocks),
        )
    )
    body = answered(blocks, rows)
    assert wire.replies(blocks, body) == tuple(Reply(status, found) for status, found in rows)
    with pytest.raises(DocumentError):
        wire.replies(blocks, body[: data.draw(st.integers(0, len(body) - 1))])
    with pytest.raises(DocumentError):
        wire.replies(blocks, body + b"\0")


@given(blocks_asked, st.binary(max_size=200), st.binary(max_size=12))
def test_whatever_comes_is_read_or_refused(blocks: list[Block], body: bytes, head: bytes) -> None:
    for call in (lambda: wire.replies(blocks, body), lambda: wire.header(head), lambda: wire.values(body, 3)):
        try:
            call()
        except DocumentError as error:
            assert "\n" not in str(error)


def test_a_frame_that_announces_too_much_is_refused_before_it_is_read() -> None:
    with pytest.raises(DocumentError, match="above the limit"):
        wire.header(wire.MAGIC + struct.pack(">HHH", 4, wire.ANSWER, wire.BODY_BYTES_MAX + 1))
