"""Actions that a session asks of its transport, and the message of a host application's STATE."""

import json
from typing import NamedTuple

from sparkplug.errors import PayloadError

STATE_BYTES_MAX = 1024


class Publish(NamedTuple):
    """Publish `payload` on `topic`."""

    topic: str
    payload: bytes
    qos: int = 0
    retain: bool = False


class Subscribe(NamedTuple):
    """Subscribe to `topic_filter`."""

    topic_filter: str
    qos: int = 1


class Connect(NamedTuple):
    """Open a connection with this will (if any), and a clean session (3.1.1) or a clean start and no session expiry (5.0).

    keep_s: the broker is to keep the session, and what it could not deliver, for so long (5.0) or for good (3.1.1); 0 = clean
    """

    will: Publish | None
    keep_s: int = 0


class Acknowledge(NamedTuple):
    """Tell the broker that these messages of QoS 1 need not be delivered again; they came on the present connection."""

    packet_ids: tuple[int, ...]


class Disconnect(NamedTuple):
    """Close the connection. `with_will` is reason 0x04 of MQTT 5; it is ignored with 3.1.1."""

    with_will: bool = False


class WalkToNextServer(NamedTuple):
    """Close the connection and go on to the next broker of the list (5.4, primary host offline)."""


class Barrier(NamedTuple):
    """Publish `token` at QoS 1 and tell when the broker has acknowledged it.

    A broker takes the packets of a connection in order, so it has then taken all that was sent before, QoS 0 included.
    """

    topic: str
    token: int


Action = Acknowledge | Barrier | Publish | Subscribe | Disconnect | WalkToNextServer


class HostState(NamedTuple):
    """The state of a host application: online or not, since when (ms since 1970, UTC)."""

    online: bool
    timestamp_ms: int

    def encode(self) -> bytes:
        """The JSON of a STATE message.

        >>> HostState(True, 1668114759262).encode()
        b'{"online":true,"timestamp":1668114759262}'
        """
        return json.dumps({"online": self.online, "timestamp": self.timestamp_ms}, separators=(",", ":")).encode()

    @classmethod
    def decode(cls, payload: bytes) -> "HostState":
        """Read a STATE message; raises PayloadError where it is none (2.2 sent the words ONLINE and OFFLINE)."""
        if len(payload) > STATE_BYTES_MAX:
            raise PayloadError(f"STATE of {len(payload)} bytes is above the limit of {STATE_BYTES_MAX}")
        try:
            state = json.loads(payload)
        except ValueError as error:
            raise PayloadError(f"STATE {payload[:40]!r} is not JSON: {error}") from error
        if not isinstance(state, dict) or type(state.get("online")) is not bool or type(state.get("timestamp")) is not int:
            raise PayloadError(f"STATE {payload[:80]!r} needs a boolean 'online' and a whole number 'timestamp'")
        return cls(state["online"], state["timestamp"])
