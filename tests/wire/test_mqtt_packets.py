"""The packet parser against packets written by hand from the tables of the MQTT specifications."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.wire.mqtt_packets import (
    Acknowledgement,
    Auth,
    Connack,
    Connect,
    Disconnect,
    Packet,
    PacketReader,
    Ping,
    Publish,
    Suback,
    Subscribe,
    Unsubscribe,
    Will,
)
from tests.wire.mqtt_properties import MalformedPacketError

CONNECT_311 = bytes.fromhex(
    "10 2a 0004 4d515454 04 ee 003c 0004 65646765 0005 612f622f63 0003 010203 0004 75736572 0006 736563726574"
)
CONNECT_5 = bytes.fromhex(
    "10 28 0004 4d515454 05 0e 003c 05 11 00000000 0004 65646765 05 18 00000007 0005 612f622f63 0003 010203"
)

CASES = [
    (
        CONNECT_311,
        4,
        Connect(44, 4, "edge", True, 60, Will("a/b/c", b"\1\2\3", qos=1, retain=True), "user", b"secret"),
    ),
    (
        CONNECT_5,
        4,
        Connect(
            42,
            5,
            "edge",
            True,
            60,
            Will("a/b/c", b"\1\2\3", qos=1, retain=False, properties=(("will_delay_interval", 7),)),
            None,
            None,
            (("session_expiry_interval", 0),),
        ),
    ),
    (bytes.fromhex("10 0f 0004 4d515454 04 00 000a 0003 616263"), 4, Connect(17, 4, "abc", False, 10, None, None, None)),
    (bytes.fromhex("20 02 00 00"), 4, Connack(4, session_present=False, reason=0)),
    (bytes.fromhex("20 02 01 05"), 4, Connack(4, session_present=True, reason=5)),
    (bytes.fromhex("20 06 00 00 03 22 000a"), 5, Connack(8, False, 0, (("topic_alias_maximum", 10),))),
    (bytes.fromhex("30 05 0001 74 7878"), 4, Publish(7, "t", b"xx", 0, False, False, None)),
    (bytes.fromhex("3b 07 0001 74 0102 7878"), 4, Publish(9, "t", b"xx", 1, True, True, 258)),
    (bytes.fromhex("30 06 0001 74 00 7878"), 5, Publish(8, "t", b"xx", 0, False, False, None)),
    (
        bytes.fromhex("30 0c 0001 74 07 26 0001 61 0001 62 78"),
        5,
        Publish(14, "t", b"x", 0, False, False, None, (("user_property", ("a", "b")),)),
    ),
    (bytes.fromhex("40 02 0102"), 4, Acknowledgement(4, "puback", 258)),
    (bytes.fromhex("40 04 0102 87 00"), 5, Acknowledgement(6, "puback", 258, 0x87)),
    (bytes.fromhex("50 02 0001"), 4, Acknowledgement(4, "pubrec", 1)),
    (bytes.fromhex("62 02 0001"), 4, Acknowledgement(4, "pubrel", 1)),
    (bytes.fromhex("70 02 0001"), 4, Acknowledgement(4, "pubcomp", 1)),
    (bytes.fromhex("82 0b 0001 0001 61 01 0002 2f23 00"), 4, Subscribe(13, 1, (("a", 1), ("/#", 0)))),
    (bytes.fromhex("82 07 0001 00 0001 61 2d"), 5, Subscribe(9, 1, (("a", 1),))),
    (bytes.fromhex("90 04 0001 01 80"), 4, Suback(6, 1, (1, 0x80))),
    (bytes.fromhex("90 04 0001 00 01"), 5, Suback(6, 1, (1,))),
    (bytes.fromhex("a2 05 0001 0001 61"), 4, Unsubscribe(7, 1, ("a",))),
    (bytes.fromhex("b0 02 0001"), 4, Acknowledgement(4, "unsuback", 1)),
    (bytes.fromhex("c0 00"), 4, Ping(2, answer=False)),
    (bytes.fromhex("d0 00"), 4, Ping(2, answer=True)),
    (bytes.fromhex("e0 00"), 4, Disconnect(2)),
    (bytes.fromhex("e0 01 04"), 5, Disconnect(3, 4)),
    (bytes.fromhex("e0 07 00 05 11 00000000"), 5, Disconnect(9, 0, (("session_expiry_interval", 0),))),
    (bytes.fromhex("f0 01 18"), 5, Auth(3, 0x18)),
]


@pytest.mark.parametrize(("raw", "version", "packet"), CASES, ids=lambda case: getattr(case, "hex", lambda: "")()[:12])
def test_each_packet_is_read_as_the_specification_lays_it_out(raw: bytes, version: int, packet: Packet) -> None:
    reader = PacketReader(version)
    assert reader.feed(raw) == [packet]
    assert reader.pending == b""


@given(st.lists(st.integers(1, 40), min_size=1, max_size=30))
def test_the_cuts_of_the_stream_make_no_difference(sizes: list[int]) -> None:
    stream = b"".join(raw for raw, version, _ in CASES if version == 4 and raw is not CONNECT_5)
    reader, packets, at = PacketReader(), [], 0
    for size in [*sizes, len(stream)]:
        packets += reader.feed(stream[at : at + size])
        at += size
    assert packets == [packet for raw, version, packet in CASES if version == 4 and raw is not CONNECT_5]


def test_a_connect_tells_the_version_of_what_follows() -> None:
    reader = PacketReader()
    assert reader.feed(CONNECT_5 + bytes.fromhex("30 06 0001 74 00 7878"))[1] == Publish(8, "t", b"xx", 0, False, False, None)


def test_a_large_packet_waits_for_its_last_byte() -> None:
    raw = bytes.fromhex("30 c3 8b 01 0001 74") + bytes(17856)
    reader = PacketReader()
    assert reader.feed(raw[:-1]) == []
    (packet,) = reader.feed(raw[-1:])
    assert packet == Publish(len(raw), "t", bytes(17856), 0, False, False, None)


@pytest.mark.parametrize(
    ("raw", "why"),
    [
        (b"GET / HTTP/1.1\r\n\r\n" + bytes(80), "reserved flags 7"),
        (bytes.fromhex("00 00"), "type 0"),
        (bytes.fromhex("20 01 00"), "a field of 1 bytes in the last 0"),
        (bytes.fromhex("30 ff ff ff ff 7f"), "more than four bytes"),
        (bytes.fromhex("30 ff ff ff 7f"), "above"),
        (bytes.fromhex("30 03 0001 ff"), "no UTF-8"),
        (bytes.fromhex("10 04 0002 4142"), "not MQTT"),
    ],
    ids=lambda case: case if isinstance(case, str) else "",
)
def test_what_is_no_mqtt_is_refused(raw: bytes, why: str) -> None:
    with pytest.raises(MalformedPacketError, match=why):
        PacketReader().feed(raw)
