"""The way of messages through paho: all that comes is paho's to read, and all that goes out is paho's to write."""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import MQTTErrorCode
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.reasoncodes import ReasonCode

from sparkplug.actions import Action, Publish
from sparkplug.transport.listener import Listener
from sparkplug.transport.paho_client import StreamClient
from sparkplug.transport.sendable import Sendable
from sparkplug.transport.stream import Stream


class PahoPath:
    """Serves one connection, once its socket is connected. Its methods are called by one thread at a time.

    `refused` is called with the reason for which the broker has not taken a barrier. A message that is not `sendable` is dropped.
    """

    def __init__(
        self,
        client: StreamClient,
        stream: Stream,
        listener: Listener,
        refused: Callable[[str], None],
        sendable: Sendable,
    ) -> None:
        self._client, self._stream = client, stream
        self._listener, self._refused, self._sendable = listener, refused, sendable
        self._barriers: dict[int, int] = {}  # packet id → token
        self._reading = False
        client.on_message = self._on_message

    def received(self, data: bytes) -> None:
        """Read what has come."""
        self._let_paho_read(data)

    def ended(self) -> None:
        """Have paho learn that the stream has ended."""
        self._client.loop_read()

    def publish_unconfirmed(self, _outbox: deque[Action], _bytes_max: int) -> int:
        """Write nothing: paho takes one message at a time."""
        return 0

    def publish(self, action: Publish) -> bool:
        """Write a message; False where there are too many that the broker has not acknowledged."""
        if self._sendable.takes(action):
            self._client.publish(action.topic, action.payload, action.qos, action.retain)
        return True

    def barrier(self, topic: str, token: int) -> bool:
        """Write a barrier; False as for a message."""
        self._client.on_publish = self._on_publish  # only while a barrier is out: it would be called for each QoS 0 message too
        told = self._client.publish(topic, str(token), 1)
        if told.rc == MQTTErrorCode.MQTT_ERR_SUCCESS:  # else an older barrier, 65,535 packets ago, still has that id
            self._barriers[told.mid] = token
        return True

    def acknowledge(self, _packet_ids: Sequence[int]) -> None:
        """Do nothing: paho has acknowledged them as they came."""

    def _let_paho_read(self, data: bytes) -> bool:
        """Give paho bytes to read; False when it has ended the connection."""
        client, stream = self._client, self._stream
        stream.give(data)
        self._reading = True
        try:
            while stream.given and client.socket() is not None:
                client.loop_read()
        finally:
            self._reading = False
        return client.socket() is not None

    def _on_message(self, _client: Any, _userdata: Any, message: paho.MQTTMessage) -> None:
        topic = message.topic
        if not topic or (message.properties is not None and hasattr(message.properties, "TopicAlias")):
            raise ValueError("the broker uses a topic alias, which we have not allowed")
        if self._listener.wanted(topic):
            self._listener.message(topic, bytes(message.payload))

    def _on_publish(self, client: Any, _userdata: Any, packet_id: int, reason: Any, _properties: Any) -> None:
        # What was read is an acknowledgement; a QoS 0 message that was written may have the id of a barrier, after 65,535 others.
        token = self._barriers.pop(packet_id, None) if self._reading else None
        if token is None:
            return
        if not self._barriers:
            client.on_publish = None
        self._settle(token, reason)

    def _settle(self, token: int, reason: ReasonCode) -> None:
        if reason.is_failure:
            self._refused(str(reason))
        else:
            self._listener.confirmed(token)


def puback_reason(code: int) -> ReasonCode:
    """Return the reason of a PUBACK; an unspecified error for a code that MQTT does not know."""
    try:
        return ReasonCode(PacketTypes.PUBACK, identifier=code)
    except KeyError:
        return ReasonCode(PacketTypes.PUBACK, "Unspecified error")
