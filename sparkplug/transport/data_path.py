"""The way of messages past paho: PUBLISH and PUBACK are read and written here, the rest of MQTT is left to paho.

Packet ids of ours are the upper half. paho numbers its own, which are those of SUBSCRIBE then, from 1.
"""

from collections import deque
from collections.abc import Callable, Sequence

from sparkplug.actions import Action, Publish
from sparkplug.transport.listener import Listener
from sparkplug.transport.packets import PacketReader, PacketWriter, Reader, puback
from sparkplug.transport.paho_client import StreamClient
from sparkplug.transport.paho_path import PahoPath, puback_reason
from sparkplug.transport.sendable import Sendable
from sparkplug.transport.stream import Stream

PACKET_ID_MIN = 32_768
PACKET_ID_MAX = 65_535
UNACKNOWLEDGED_MAX = 30_000


class DataPath(PahoPath):
    """As PahoPath, in a fraction of the time."""

    def __init__(
        self,
        client: StreamClient,
        stream: Stream,
        listener: Listener,
        refused: Callable[[str], None],
        sendable: Sendable,
    ) -> None:
        super().__init__(client, stream, listener, refused, sendable)
        version = int(client.protocol)
        reader = Reader(listener.message, self._acknowledge, self._acknowledged, self._let_paho_read, listener.wanted)
        self._reader = PacketReader(version, reader)
        self._writer = PacketWriter(version)
        self._unacknowledged: dict[int, int | None] = {}  # packet id → token of a barrier
        self._packet_id = PACKET_ID_MAX

    def received(self, data: bytes) -> None:
        """Read what has come."""
        self._reader.feed(data)

    def publish_unconfirmed(self, outbox: deque[Action], bytes_max: int) -> int:
        """Write messages of QoS 0 from the head of the outbox, until `bytes_max` wait; return the size of their payloads."""
        stream, compose, sendable = self._stream, self._writer.publish, self._sendable
        packet_bytes_max = sendable.packet_bytes_max
        packets: list[bytes] = []
        room, written = bytes_max - stream.size, 0
        while outbox and room > 0:
            action = outbox[0]
            if not isinstance(action, Publish):
                break
            topic, payload, qos, retain = action
            if qos:
                break
            outbox.popleft()
            written += len(payload)
            try:
                packet = compose(topic, payload, retain)
            except ValueError as error:
                sendable.drop(topic, str(error))
                continue
            if (size := len(packet)) > packet_bytes_max and not sendable.holds(topic, size):
                continue
            packets.append(packet)
            room -= size
        stream.add_all(packets)
        return written

    def publish(self, action: Publish) -> bool:
        """Write a message that is confirmed; False where there are too many that the broker has not acknowledged."""
        topic, payload, qos, retain = action
        return self._confirmed_publish(topic, payload, None, retain=retain) if qos == 1 else super().publish(action)

    def barrier(self, topic: str, token: int) -> bool:
        """Write a barrier; False as for a message."""
        return self._confirmed_publish(topic, str(token).encode(), token, retain=False)

    def _confirmed_publish(self, topic: str, payload: bytes, token: int | None, *, retain: bool) -> bool:
        if len(self._unacknowledged) >= UNACKNOWLEDGED_MAX:
            return False
        packet_id = self._packet_id
        while packet_id == self._packet_id or packet_id in self._unacknowledged:
            packet_id = packet_id + 1 if packet_id < PACKET_ID_MAX else PACKET_ID_MIN
        try:
            packet = self._writer.publish_confirmed(topic, payload, packet_id, retain=retain)
        except ValueError as error:
            self._sendable.drop(topic, str(error))
            return True
        if not self._sendable.holds(topic, len(packet)):
            return True
        self._stream.add(packet)
        self._packet_id = packet_id
        self._unacknowledged[packet_id] = token
        return True

    def acknowledge(self, packet_ids: Sequence[int]) -> None:
        """Acknowledge messages that the listener has held."""
        self._stream.add_all([puback(packet_id) for packet_id in packet_ids])

    def _acknowledge(self, packet_id: int) -> None:
        if not self._listener.holds(packet_id):
            self._stream.add(puback(packet_id))

    def _acknowledged(self, packet_id: int, code: int) -> bool:
        if packet_id not in self._unacknowledged:
            return False
        token = self._unacknowledged.pop(packet_id)
        if token is not None:
            self._settle(token, puback_reason(code))
        return True
