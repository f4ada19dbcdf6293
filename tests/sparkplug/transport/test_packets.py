"""The packets that we read and write ourselves, and that all others reach paho as they came."""

from __future__ import annotations

import socket
from collections import deque
from contextlib import suppress

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sparkplug.actions import Action, Publish
from sparkplug.transport import packets
from sparkplug.transport.data_path import DataPath
from sparkplug.transport.packets import PacketReader, PacketWriter, Reader, puback
from sparkplug.transport.paho_path import PahoPath
from sparkplug.transport.sendable import Sendable, topic_fault
from tests.sparkplug.transport.pair import client_on, listener_of, nothing
from tests.wire import mqtt_packets

OURS = 40_000  # a packet id that we wait for
UNWANTED = "not/for/us"
TOPICS = ("a", "spBv1.0/cnc/DDATA/edge-okuma/okuma", "größe/♥", "x" * 200, UNWANTED)
PROPERTIES = (
    b"\0",
    bytes.fromhex("02 01 01"),  # payload format
    bytes.fromhex("05 02 00 00 00 3c"),  # message expiry
    bytes.fromhex("09 26 00 01 61 00 03 62 62 62"),  # user property
    bytes.fromhex("0a 03 00 02 6f 6b 0b ff 01 01 00"),  # content type, subscription identifier, payload format
)
ALIASES = (bytes.fromhex("03 23 00 01"), bytes.fromhex("05 01 00 23 00 01"))  # of a topic, which we do not allow

Event = tuple[str, object]


class Told:
    """Keeps what a reader says, in order; bytes for others joined where they follow each other."""

    def __init__(self) -> None:
        self.events: list[Event] = []

    def other(self, data: bytes) -> bool:
        if self.events and self.events[-1][0] == "other":
            data = bytes(self.events.pop()[1]) + data  # type: ignore[call-overload]
        self.events.append(("other", data))
        return True

    def acknowledged(self, packet_id: int, reason: int) -> bool:
        if packet_id != OURS:
            return False
        self.events.append(("acknowledged", reason))
        return True

    def reader(self, version: int) -> PacketReader:
        told = Reader(
            lambda topic, payload: self.events.append(("message", (topic, payload))),
            lambda packet_id: self.events.append(("acknowledge", packet_id)),
            self.acknowledged,
            self.other,
            lambda topic: topic != UNWANTED,
        )
        return PacketReader(version, told)


def framed(first: int, body: bytes) -> bytes:
    return bytes((first,)) + packets._encoded_length(len(body)) + body


@st.composite
def publishes(draw: st.DrawFn, version: int) -> tuple[bytes, list[Event]]:
    """A PUBLISH with what is to be said of it."""
    topic, payload = draw(st.sampled_from(TOPICS)), draw(st.binary(max_size=300))
    qos, retain = draw(st.integers(0, 1)), draw(st.booleans())
    packet_id = draw(st.integers(1, 65_535))
    name = topic.encode()
    properties = draw(st.sampled_from(PROPERTIES + ALIASES)) if version == 5 else b""
    body = len(name).to_bytes(2) + name + (packet_id.to_bytes(2) if qos else b"") + properties + payload
    packet = framed(0x30 | qos << 1 | retain, body)
    if properties in ALIASES:
        return packet, [("other", packet)]
    events: list[Event] = [] if topic == UNWANTED else [("message", (topic, payload))]
    return packet, events + ([("acknowledge", packet_id)] if qos else [])


@st.composite
def others(draw: st.DrawFn) -> tuple[bytes, list[Event]]:
    """A packet that is none of ours: another type, QoS 2 or 3, no topic, a topic that is no UTF-8, PUBACK of an unknown id."""
    body = draw(st.binary(max_size=200))
    packet = draw(
        st.sampled_from(
            (
                framed(draw(st.sampled_from((0x20, 0x50, 0x62, 0x90, 0xD0, 0xE0, 0xF0))), body),
                framed(0x34, b"\0\x01a\0\x07" + body),
                framed(0x36, b"\0\x01a\0\x07" + body),
                framed(0x30, b"\0\0" + body),
                framed(0x30, b"\0\x02\xff\xfe" + body),
                framed(0x30, b"\xff"),
                framed(0x32, b"\0\x01a\0\0" + body),
                puback(7),
            )
        )
    )
    return packet, [("other", packet)]


@st.composite
def streams(draw: st.DrawFn) -> tuple[int, bytes, list[Event], list[int]]:
    """An MQTT version, the bytes that come, what is to be said of them, and where they are cut."""
    version = draw(st.sampled_from((4, 5)))
    acknowledgement = st.just((puback(OURS), [("acknowledged", 0)]))
    told = draw(st.lists(st.one_of(publishes(version), others(), acknowledgement), max_size=12))
    data = b"".join(packet for packet, _ in told)
    merged = Told()
    for _, events in told:
        for kind, what in events:
            if kind == "other":
                merged.other(what)  # type: ignore[arg-type]
            else:
                merged.events.append((kind, what))
    cuts = draw(st.lists(st.integers(0, len(data)), max_size=20))
    return version, data, merged.events, sorted(cuts)


@given(streams())
def test_however_the_bytes_are_cut_the_same_is_said_of_them(stream: tuple[int, bytes, list[Event], list[int]]) -> None:
    version, data, events, cuts = stream
    told = Told()
    reader = told.reader(version)
    for begin, end in zip([0, *cuts], [*cuts, len(data)], strict=True):
        reader.feed(data[begin:end])
    assert told.events == events


def test_a_packet_that_is_too_long_to_be_held_is_passed_on_as_it_comes() -> None:
    told = Told()
    reader = told.reader(4)
    size = packets.PACKET_BYTES_MAX + 1
    long = framed(0x30, b"\0\x01a" + bytes(size))
    data = long + framed(0x30, b"\0\x01ab")
    reader.feed(data[:10])
    assert len(reader._held) == 0
    assert told.events == [("other", data[:10])]
    for begin in range(10, len(data), 65_536):
        reader.feed(data[begin : begin + 65_536])
    assert told.events == [("other", long), ("message", ("a", b"b"))]


def test_a_length_of_too_many_bytes_ends_our_reading() -> None:
    told = Told()
    reader = told.reader(4)
    reader.feed(framed(0x30, b"\0\x01ab") + b"\x30\xff\xff")
    reader.feed(b"\xff\xff\x01" + framed(0x30, b"\0\x01ac"))
    assert told.events == [("message", ("a", b"b")), ("other", b"\x30\xff\xff\xff\xff\x01" + framed(0x30, b"\0\x01ac"))]


def test_topics_are_asked_for_once_and_kept_in_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packets, "TOPICS_MAX", 3)
    asked: list[str] = []

    def wanted(topic: str) -> bool:
        asked.append(topic)
        return True

    reader = PacketReader(4, Reader(nothing, nothing, lambda *_: False, lambda _: True, wanted))
    for _ in range(2):
        reader.feed(b"".join(framed(0x30, b"\0\x01" + name) for name in (b"a", b"b", b"c")))
    assert asked == ["a", "b", "c"]
    reader.feed(framed(0x30, b"\0\x01d") + framed(0x30, b"\0\x01a"))
    assert asked == ["a", "b", "c", "d", "a"]
    assert len(reader._topics) <= 3


@given(
    st.sampled_from((4, 5)),
    st.sampled_from(TOPICS),
    st.one_of(st.binary(max_size=300), st.integers(100, 20_000).map(bytes)),
    st.booleans(),
    st.integers(0, 65_535),
)
def test_what_is_written_is_read_by_an_independent_reader(
    version: int, topic: str, payload: bytes, retain: bool, packet_id: int
) -> None:
    writer = PacketWriter(version)
    if packet_id:
        packet = writer.publish_confirmed(topic, payload, packet_id, retain=retain)
    else:
        packet = writer.publish(topic, payload, retain=retain)
    (read,) = mqtt_packets.PacketReader(version).feed(packet)
    expected = mqtt_packets.Publish(
        len(packet), topic, payload, int(packet_id > 0), retain, duplicate=False, packet_id=packet_id or None
    )
    assert read == expected


@pytest.mark.parametrize("topic", ["", "a/+", "#", "x" * 65_536, "%25" * 30_000, "a/\x07", "a\ud800", "a\uffff", "a/" * 200])
def test_a_topic_that_mqtt_or_a_broker_does_not_allow_is_refused(topic: str) -> None:
    with pytest.raises(ValueError, match=r"^it "):
        PacketWriter(4).publish(topic, b"")
    assert topic_fault(topic)


def test_a_topic_that_is_refused_takes_no_other_message_with_it() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        client, stream = client_on(ours)
        sendable = Sendable("test")
        path = DataPath(client, stream, listener_of(), nothing, sendable)
        confirmed = Publish("a", b"qos 1", 1)
        outbox: deque[Action] = deque(
            [Publish("a", b"1"), Publish("a/+", b"2"), Publish("a", b"3"), confirmed, Publish("a", b"4")]
        )
        assert path.publish_unconfirmed(outbox, 1000) == 3
        assert sendable.unsendable == 1
        assert list(outbox) == [confirmed, Publish("a", b"4")]
        outbox.popleft()
        assert path.publish_unconfirmed(outbox, stream.size) == 0, "as much waits as may"
        assert stream.unsent == 2
        assert stream.flush()
        assert theirs.recv(100).hex(" ") == "30 04 00 01 61 31 30 04 00 01 61 33"


def outcome(kind: type[PahoPath], version: int, data: bytes, cuts: list[int]) -> tuple[object, ...]:
    """Return what comes of these bytes: messages, what is answered, whether the connection goes on, and the error, if any."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        client, stream = client_on(ours, version)
        messages: list[tuple[str, bytes]] = []
        path = kind(client, stream, listener_of(message=lambda *message: messages.append(message)), nothing, Sendable(""))
        error: type[Exception] | None = None
        for begin, end in zip([0, *cuts], [*cuts, len(data)], strict=True):
            try:
                path.received(data[begin:end])
            except Exception as failure:
                error = type(failure)
                break
            if client.socket() is None:
                break
        goes_on = client.socket() is not None
        if goes_on and error is None:
            stream.has_ended = True
            with suppress(OSError):
                path.ended()
            assert client.socket() is None
        return messages, b"".join(stream._pieces), goes_on, error


@given(st.sampled_from((4, 5)), st.one_of(st.binary(max_size=400), streams().map(lambda s: s[1])), st.data())
@example(5, framed(0x30, b"\0\0" + ALIASES[0] + b"x"), None)
def test_whatever_comes_has_the_outcome_that_it_has_with_paho_alone(
    version: int, data: bytes, chance: st.DataObject | None
) -> None:
    cuts: list[int] = []
    if chance is not None:
        cuts = sorted(chance.draw(st.lists(st.integers(0, len(data)), max_size=4)))
        for _ in range(chance.draw(st.integers(0, 2))):
            at = chance.draw(st.integers(0, max(len(data) - 1, 0)))
            data = data[:at] + chance.draw(st.binary(max_size=3)) + data[at + 1 :]
        cuts = [min(cut, len(data)) for cut in cuts]
    assert outcome(DataPath, version, data, cuts) == outcome(PahoPath, version, data, cuts)
