"""MQTT 3.1.1 and 5.0 control packets, parsed from a byte stream as it arrives.

>>> PacketReader().feed(bytes.fromhex("c0 00 c0"))[0]
Ping(size=2, answer=False)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from tests.wire.mqtt_properties import Cursor, MalformedPacketError, Properties

MQTT_5 = 5
PACKET_BYTES_MAX = 32 * 1024 * 1024
PUBLISH = 3
# PUBREL, SUBSCRIBE and UNSUBSCRIBE carry the reserved flags 0010, all others 0000 (2.1.3).
FLAGS_TWO = frozenset({6, 8, 10})


@dataclass(frozen=True)
class Packet:
    """What all control packets have: the bytes they take on the wire."""

    size: int


@dataclass(frozen=True)
class Will:
    """The message that the broker publishes when the connection ends without a DISCONNECT."""

    topic: str
    payload: bytes
    qos: int
    retain: bool
    properties: Properties = ()


@dataclass(frozen=True)
class Connect(Packet):
    """The first packet of a client; `clean` is Clean Session (3.1.1) or Clean Start (5.0)."""

    version: int
    client_id: str
    clean: bool
    keepalive_s: int
    will: Will | None
    username: str | None
    password: bytes | None = field(repr=False)
    properties: Properties = ()


@dataclass(frozen=True)
class Connack(Packet):
    """The broker's answer to CONNECT; reason 0 is success."""

    session_present: bool
    reason: int
    properties: Properties = ()


@dataclass(frozen=True)
class Publish(Packet):
    """An application message on its way in either direction."""

    topic: str
    payload: bytes
    qos: int
    retain: bool
    duplicate: bool
    packet_id: int | None
    properties: Properties = ()


@dataclass(frozen=True)
class Acknowledgement(Packet):
    """PUBACK, PUBREC, PUBREL, PUBCOMP or UNSUBACK, told apart by `kind`."""

    kind: str
    packet_id: int
    reason: int = 0


@dataclass(frozen=True)
class Subscribe(Packet):
    """The filters that a client asks for, each with its maximum QoS."""

    packet_id: int
    filters: tuple[tuple[str, int], ...]
    properties: Properties = ()


@dataclass(frozen=True)
class Suback(Packet):
    """What the broker grants for each filter: a QoS, or 0x80 and above for a refusal."""

    packet_id: int
    reasons: tuple[int, ...]


@dataclass(frozen=True)
class Unsubscribe(Packet):
    """The filters that a client gives up."""

    packet_id: int
    filters: tuple[str, ...]


@dataclass(frozen=True)
class Ping(Packet):
    """PINGREQ, or its answer PINGRESP."""

    answer: bool


@dataclass(frozen=True)
class Disconnect(Packet):
    """The last packet; MQTT 5.0 gives a reason, 0x04 asks the broker to send the will."""

    reason: int = 0
    properties: Properties = ()


@dataclass(frozen=True)
class Auth(Packet):
    """The exchange of MQTT 5.0 that goes on between CONNECT and CONNACK."""

    reason: int = 0


class PacketReader:
    """Takes the bytes of one direction of one connection and hands back whole packets.

    The layout of most packets depends on the version that CONNECT names: the reader of the other direction is told it by setting
    `version`.
    """

    def __init__(self, version: int = 4) -> None:
        self.version = version
        self._buffer = bytearray()

    @property
    def pending(self) -> bytes:
        """The bytes of a packet that has begun and is not whole yet."""
        return bytes(self._buffer)

    def feed(self, data: bytes) -> list[Packet]:
        """All packets that are whole with these bytes; raises MalformedPacketError for what is no MQTT."""
        self._buffer += data
        packets = []
        while (size := _packet_size(self._buffer)) is not None and size <= len(self._buffer):
            raw = bytes(self._buffer[:size])
            del self._buffer[:size]
            packet = parse_packet(raw, self.version)
            if isinstance(packet, Connect):
                self.version = packet.version
            packets.append(packet)
        return packets


def _packet_size(buffer: bytes | bytearray) -> int | None:
    """The bytes that the first packet of a buffer takes; None where the header is not whole yet."""
    length = 0
    for index, byte in enumerate(buffer[1:5]):
        length |= (byte & 0x7F) << (7 * index)
        if byte < 0x80:
            size = 2 + index + length
            if size > PACKET_BYTES_MAX:
                raise MalformedPacketError(f"a packet of {size} bytes is above {PACKET_BYTES_MAX}")
            return size
        if index == 3:
            raise MalformedPacketError("a remaining length of more than four bytes")
    return None


def parse_packet(raw: bytes, version: int) -> Packet:
    """One whole packet with its fixed header; raises MalformedPacketError."""
    header = Cursor(raw)
    first = header.integer(1)
    header.variable()
    body = Cursor(header.rest())
    kind = first >> 4
    if kind not in _PARSERS:
        raise MalformedPacketError(f"packet type {kind} does not exist")
    if kind != PUBLISH and first & 0x0F != (2 if kind in FLAGS_TWO else 0):
        raise MalformedPacketError(f"packet type {kind} has the reserved flags {first & 0x0F}")
    try:
        return _PARSERS[kind](len(raw), first & 0x0F, body, version)
    except UnicodeDecodeError as error:
        raise MalformedPacketError(f"packet type {kind} has a string that is no UTF-8") from error


def _connect(size: int, _flags: int, body: Cursor, _version: int) -> Packet:
    protocol = body.text()
    if protocol not in {"MQTT", "MQIsdp"}:
        raise MalformedPacketError(f"protocol name {protocol!r} is not MQTT")
    version, flags, keepalive_s = body.integer(1), body.integer(1), body.integer(2)
    properties = body.properties() if version >= MQTT_5 else ()
    client_id = body.text()
    will = None
    if flags & 0x04:
        will_properties = body.properties() if version >= MQTT_5 else ()
        will = Will(body.text(), body.binary(), (flags >> 3) & 0x03, bool(flags & 0x20), will_properties)
    username = body.text() if flags & 0x80 else None
    password = body.binary() if flags & 0x40 else None
    clean = bool(flags & 0x02)
    return Connect(size, version, client_id, clean, keepalive_s, will, username, password, properties)


def _connack(size: int, _flags: int, body: Cursor, version: int) -> Packet:
    session_present, reason = bool(body.integer(1) & 1), body.integer(1)
    return Connack(size, session_present, reason, body.properties() if version >= MQTT_5 and body.left else ())


def _publish(size: int, flags: int, body: Cursor, version: int) -> Packet:
    qos = (flags >> 1) & 0x03
    topic = body.text()
    packet_id = body.integer(2) if qos else None
    properties = body.properties() if version >= MQTT_5 else ()
    return Publish(size, topic, body.rest(), qos, bool(flags & 1), bool(flags & 8), packet_id, properties)


def _acknowledgement(kind: str) -> Callable[[int, int, Cursor, int], Packet]:
    def parse(size: int, _flags: int, body: Cursor, _version: int) -> Packet:
        return Acknowledgement(size, kind, body.integer(2), body.integer(1) if body.left else 0)

    return parse


def _subscribe(size: int, _flags: int, body: Cursor, version: int) -> Packet:
    packet_id = body.integer(2)
    properties = body.properties() if version >= MQTT_5 else ()
    filters = []
    while body.left:
        filters.append((body.text(), body.integer(1) & 0x03))
    return Subscribe(size, packet_id, tuple(filters), properties)


def _suback(size: int, _flags: int, body: Cursor, version: int) -> Packet:
    packet_id = body.integer(2)
    if version >= MQTT_5:
        body.properties()
    return Suback(size, packet_id, tuple(body.rest()))


def _unsubscribe(size: int, _flags: int, body: Cursor, version: int) -> Packet:
    packet_id = body.integer(2)
    if version >= MQTT_5:
        body.properties()
    filters = []
    while body.left:
        filters.append(body.text())
    return Unsubscribe(size, packet_id, tuple(filters))


def _ping(answer: bool) -> Callable[[int, int, Cursor, int], Packet]:
    return lambda size, _flags, _body, _version: Ping(size, answer)


def _disconnect(size: int, _flags: int, body: Cursor, _version: int) -> Packet:
    reason = body.integer(1) if body.left else 0
    return Disconnect(size, reason, body.properties() if body.left else ())


def _auth(size: int, _flags: int, body: Cursor, _version: int) -> Packet:
    return Auth(size, body.integer(1) if body.left else 0)


_PARSERS: dict[int, Callable[[int, int, Cursor, int], Packet]] = {
    1: _connect,
    2: _connack,
    3: _publish,
    4: _acknowledgement("puback"),
    5: _acknowledgement("pubrec"),
    6: _acknowledgement("pubrel"),
    7: _acknowledgement("pubcomp"),
    8: _subscribe,
    9: _suback,
    10: _unsubscribe,
    11: _acknowledgement("unsuback"),
    12: _ping(answer=False),
    13: _ping(answer=True),
    14: _disconnect,
    15: _auth,
}
