"""The properties of MQTT 5.0 packets (2.2.2), and the integers and strings that all packets are made of."""

from typing import NamedTuple


class MalformedPacketError(Exception):
    """Bytes that are no MQTT packet."""


class PropertyKind(NamedTuple):
    """The name of a property and how its value is written."""

    name: str
    shape: str


PROPERTIES = {
    0x01: PropertyKind("payload_format_indicator", "byte"),
    0x02: PropertyKind("message_expiry_interval", "four"),
    0x03: PropertyKind("content_type", "text"),
    0x08: PropertyKind("response_topic", "text"),
    0x09: PropertyKind("correlation_data", "binary"),
    0x0B: PropertyKind("subscription_identifier", "variable"),
    0x11: PropertyKind("session_expiry_interval", "four"),
    0x12: PropertyKind("assigned_client_identifier", "text"),
    0x13: PropertyKind("server_keep_alive", "two"),
    0x15: PropertyKind("authentication_method", "text"),
    0x16: PropertyKind("authentication_data", "binary"),
    0x17: PropertyKind("request_problem_information", "byte"),
    0x18: PropertyKind("will_delay_interval", "four"),
    0x19: PropertyKind("request_response_information", "byte"),
    0x1A: PropertyKind("response_information", "text"),
    0x1C: PropertyKind("server_reference", "text"),
    0x1F: PropertyKind("reason_string", "text"),
    0x21: PropertyKind("receive_maximum", "two"),
    0x22: PropertyKind("topic_alias_maximum", "two"),
    0x23: PropertyKind("topic_alias", "two"),
    0x24: PropertyKind("maximum_qos", "byte"),
    0x25: PropertyKind("retain_available", "byte"),
    0x26: PropertyKind("user_property", "pair"),
    0x27: PropertyKind("maximum_packet_size", "four"),
    0x28: PropertyKind("wildcard_subscription_available", "byte"),
    0x29: PropertyKind("subscription_identifier_available", "byte"),
    0x2A: PropertyKind("shared_subscription_available", "byte"),
}
Properties = tuple[tuple[str, object], ...]


class Cursor:
    """A place in the body of one packet that moves on as fields are taken."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    @property
    def left(self) -> int:
        """Return how many bytes are still to come."""
        return len(self._data) - self._at

    def take(self, count: int) -> bytes:
        """The next `count` bytes; raises MalformedPacketError where the packet ends before."""
        if count > self.left:
            raise MalformedPacketError(f"a field of {count} bytes in the last {self.left} bytes of a packet")
        self._at += count
        return self._data[self._at - count : self._at]

    def rest(self) -> bytes:
        """All bytes that are left."""
        return self.take(self.left)

    def integer(self, size: int) -> int:
        """An unsigned number, most significant byte first."""
        return int.from_bytes(self.take(size), "big")

    def variable(self) -> int:
        """A number of one to four bytes with seven bits each, the lowest first (1.5.5)."""
        value = 0
        for shift in (0, 7, 14, 21):
            byte = self.integer(1)
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value
        raise MalformedPacketError("a variable byte integer of more than four bytes")

    def binary(self) -> bytes:
        """Bytes behind their length in two bytes."""
        return self.take(self.integer(2))

    def text(self) -> str:
        """A UTF-8 string behind its length in two bytes."""
        return self.binary().decode("utf-8")

    def properties(self) -> Properties:
        """The property block of an MQTT 5.0 packet, in the order of the wire."""
        block = Cursor(self.take(self.variable()))
        found: list[tuple[str, object]] = []
        while block.left:
            code = block.variable()
            if code not in PROPERTIES:
                raise MalformedPacketError(f"property 0x{code:02x} is not one of MQTT 5.0")
            name, shape = PROPERTIES[code]
            found.append((name, block._value(shape)))
        return tuple(found)

    def _value(self, shape: str) -> object:
        match shape:
            case "byte":
                return self.integer(1)
            case "two":
                return self.integer(2)
            case "four":
                return self.integer(4)
            case "variable":
                return self.variable()
            case "text":
                return self.text()
            case "binary":
                return self.binary()
            case _:
                return (self.text(), self.text())
