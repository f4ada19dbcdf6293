"""The MQTT packets that come and go by the thousand: PUBLISH of QoS 0 and 1, and PUBACK (MQTT 3.1.1 and 5.0, 3.3 and 3.4).

Bytes in, messages out, with no I/O. All other packets, and every one that is not plainly right, are handed on byte for byte, in
order, to whoever knows all of MQTT.
"""

from collections.abc import Callable
from dataclasses import dataclass

from sparkplug.transport.sendable import topic_fault

PACKET_BYTES_MAX = 1024 * 1024  # a longer one is not held here until it is whole
TOPICS_MAX = 20_000
TOPIC_BYTES_KEPT = 1024  # a longer one is read again each time
REMAINING_LENGTH_MAX = 268_435_455
MQTT_5 = 5
SUCCESS = 0
_LENGTH_BYTES_MAX = 4
_UNWANTED = ""
_SHORT = tuple(tuple(bytes((0x30 | retain, length)) for length in range(128)) for retain in (0, 1))
"""The first bytes of a short PUBLISH of QoS 0, by retain and length."""
# The properties of a PUBLISH that say nothing to us (MQTT 5.0, 3.3.2.3), with the bytes of the value; -1: a string or binary
# data, -2: two of them, -3: a variable byte integer. A topic alias (0x23) is not among them: we allow none.
_PROPERTIES = {0x01: 1, 0x02: 4, 0x03: -1, 0x08: -1, 0x09: -1, 0x0B: -3, 0x26: -2}


@dataclass(frozen=True, slots=True)
class Reader:
    """The receivers of what is read; they are called in the order in which it came."""

    message: Callable[[str, bytes], None]
    acknowledge: Callable[[int], None]  # a message of QoS 1 has been handed on: this packet id is owed a PUBACK
    acknowledged: Callable[[int, int], bool]  # a PUBACK with its reason has come; False where the packet id is none of ours
    other: Callable[[bytes], bool]  # bytes for somebody else; False where nothing more is to be read
    wanted: Callable[[str], bool]  # asked once for each topic: False has its messages thrown away unread


class PacketReader:
    """Takes the bytes of a connection as they come."""

    def __init__(self, mqtt_version: int, reader: Reader) -> None:
        self._is_5 = mqtt_version == MQTT_5
        self._reader = reader
        self._topics: dict[bytes, str] = {}
        self._held = bytearray()  # the beginning of a packet
        self._needed = 0  # how long `_held` has to be before it is worth a look
        self._passing = 0  # bytes of a packet that is passed on as it comes; -1: all that comes

    def feed(self, data: bytes) -> None:
        """Read all packets that are whole with `data`, and keep the rest."""
        if self._passing:
            passed = len(data) if self._passing < 0 else min(self._passing, len(data))
            if self._passing > 0:
                self._passing -= passed
            if not self._reader.other(data[:passed]) or passed == len(data):
                return
            data = data[passed:]
        if self._held:
            self._held += data
            if len(self._held) < self._needed:
                return
            data = bytes(self._held)
            self._held.clear()
        rest = self._read(data)
        if rest < len(data):
            self._held += data[rest:]

    def _read(self, data: bytes) -> int:
        """Read packets; how many bytes are done with."""
        at, size = 0, len(data)
        topics, message = self._topics, self._reader.message
        while size - at >= 2:
            first, length, body = data[at], data[at + 1], at + 2
            if length > 127:
                length, body = _remaining_length(data, at + 1)
                if body < 0:  # not whole yet, or malformed
                    self._needed = size - at + 1
                    return at if length >= 0 else self._pass_on(data, at, -1)
            end = body + length
            if end > size:
                self._needed = end - at
                return at if end - at <= PACKET_BYTES_MAX else self._pass_on(data, at, end - size)
            if first < 0x32 and first >= 0x30 and length > 3:  # QoS 0, retained or not
                name_end = body + 2 + (data[body] << 8 | data[body + 1])
                topic = topics.get(data[body + 2 : name_end]) if name_end <= end else None
                payload = name_end
                if topic is not None and self._is_5:
                    payload = name_end + 1 if name_end < end and data[name_end] == 0 else self._payload_start(data, name_end, end)
                if topic is not None and payload >= 0:
                    if topic is not _UNWANTED:
                        message(topic, data[payload:end])
                    at = end
                    continue
            is_read = self._puback(data, body, end) if first == 0x40 else self._publish(first, data, body, end)
            if not is_read and not self._reader.other(data[at:end]):
                return size
            at = end
        self._needed = 2
        return at

    def _pass_on(self, data: bytes, at: int, rest: int) -> int:
        """Hand on what is there of a packet, and what follows: `rest` bytes, or everything (-1)."""
        self._passing = rest
        self._reader.other(data[at:])
        return len(data)

    def _publish(self, first: int, data: bytes, body: int, end: int) -> bool:
        """Read a PUBLISH of QoS 1, or one with a topic that is not known yet; False for what is none, or not plainly right."""
        if first not in (0x30, 0x31, 0x32, 0x33, 0x3A, 0x3B) or end - body < 3:
            return False
        name_end = body + 2 + (data[body] << 8 | data[body + 1])
        is_confirmed = first >= 0x32
        payload = name_end + 2 * is_confirmed
        if name_end == body + 2 or payload > end:
            return False
        packet_id = data[name_end] << 8 | data[name_end + 1] if is_confirmed else 0
        if is_confirmed and packet_id == 0:
            return False
        payload = self._payload_start(data, payload, end) if self._is_5 else payload
        topic = self._topic(data[body + 2 : name_end]) if payload >= 0 else None
        if topic is None:
            return False
        if topic is not _UNWANTED:
            self._reader.message(topic, data[payload:end])
        if is_confirmed:
            self._reader.acknowledge(packet_id)
        return True

    def _topic(self, name: bytes) -> str | None:
        """Return the topic, _UNWANTED for one that is not wanted, None for one that is no UTF-8."""
        known = self._topics.get(name)
        if known is None:
            try:
                known = name.decode()
            except UnicodeDecodeError:
                return None
            if not self._reader.wanted(known):
                known = _UNWANTED
            if len(name) <= TOPIC_BYTES_KEPT:
                if len(self._topics) >= TOPICS_MAX:
                    self._topics.clear()
                self._topics[name] = known
        return known

    @staticmethod
    def _payload_start(data: bytes, at: int, end: int) -> int:
        """Return where the payload begins behind the properties at `at`; -1 where they hold more than what may be skipped."""
        length, at = _remaining_length(data, at)
        stop = at + length
        if at < 0 or stop > end:
            return -1
        while at < stop:
            size = _PROPERTIES.get(data[at], 0)
            at += 1
            for _ in range(2 if size == -2 else 1):
                if size == -3:
                    at = _remaining_length(data, at)[1]
                elif size < 0:
                    at = at + 2 + (data[at] << 8 | data[at + 1]) if at + 2 <= stop else -1
                else:
                    at = at + size if size else -1
                if at < 0:
                    return -1
        return stop if at == stop else -1

    def _puback(self, data: bytes, body: int, end: int) -> bool:
        if end - body < 2 or (end - body > 2 and not self._is_5):
            return False
        reason = data[body + 2] if end - body > 2 else SUCCESS
        return self._reader.acknowledged(data[body] << 8 | data[body + 1], reason)


def _remaining_length(data: bytes, at: int) -> tuple[int, int]:
    """Read a variable byte integer (1.5.5): its value and where it ends.

    (0, -1) where it is not whole, (-1, -1) where it has too many bytes.
    """
    value = 0
    for index in range(_LENGTH_BYTES_MAX):
        if at + index >= len(data):
            return 0, -1
        byte = data[at + index]
        value |= (byte & 0x7F) << (7 * index)
        if byte < 128:
            return value, at + index + 1
    return -1, -1


def _encoded_length(length: int) -> bytes:
    encoded = bytearray()
    while True:
        length, digit = divmod(length, 128)
        encoded.append(digit | (0x80 if length else 0))
        if not length:
            return bytes(encoded)


class PacketWriter:
    """Composes PUBLISH packets. It keeps the topics that were used, written out."""

    def __init__(self, mqtt_version: int) -> None:
        self._properties = b"\0" if mqtt_version == MQTT_5 else b""
        self._heads: dict[str, bytes] = {}

    def publish(self, topic: str, payload: bytes, retain: bool = False) -> bytes:
        """Return a PUBLISH of QoS 0; raises ValueError for a topic or a payload that MQTT does not allow.

        >>> PacketWriter(4).publish("a/b", b"hi").hex(" ")
        '30 07 00 03 61 2f 62 68 69'
        """
        head = self._heads.get(topic) or self._head(topic)
        length = len(head) + len(payload)
        if length < 128:
            return _SHORT[retain][length] + head + payload
        if length < 16_384:
            return bytes((0x30 | retain, length & 0x7F | 0x80, length >> 7)) + head + payload
        return self._long(0x30 | retain, (head, payload))

    def publish_confirmed(self, topic: str, payload: bytes, packet_id: int, *, retain: bool = False) -> bytes:
        """Return a PUBLISH of QoS 1; raises ValueError for a topic or a payload that MQTT does not allow."""
        name = (self._heads.get(topic) or self._head(topic)).removesuffix(self._properties)
        return self._long(0x32 | retain, (name, packet_id.to_bytes(2), self._properties, payload))

    @staticmethod
    def _long(first: int, parts: tuple[bytes, ...]) -> bytes:
        length = sum(map(len, parts))
        if length > REMAINING_LENGTH_MAX:
            raise ValueError(f"a message of {length} bytes is above what MQTT carries, {REMAINING_LENGTH_MAX}")
        return b"".join((bytes((first,)), _encoded_length(length), *parts))

    def _head(self, topic: str) -> bytes:
        """Return the topic, written out, and the properties behind it, of which there are none."""
        if fault := topic_fault(topic):
            raise ValueError(fault)
        name = topic.encode()
        if len(self._heads) >= TOPICS_MAX:
            self._heads.clear()
        head = self._heads[topic] = len(name).to_bytes(2) + name + self._properties
        return head


def puback(packet_id: int) -> bytes:
    """Return a PUBACK that says success.

    >>> puback(258).hex(" ")
    '40 02 01 02'
    """
    return b"\x40\x02" + packet_id.to_bytes(2)
