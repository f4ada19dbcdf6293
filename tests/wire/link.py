"""One direction of a proxied connection: bytes in, whole packets out, bytes on their way when their time has come."""

from __future__ import annotations

import socket
import time
from collections import deque
from typing import Literal, NamedTuple

from tests.wire.mqtt_packets import Packet, PacketReader
from tests.wire.mqtt_properties import MalformedPacketError

Direction = Literal["up", "down"]
BUFFER_BYTES_MAX = 1024 * 1024


class Piece(NamedTuple):
    """Bytes that may go on, and the packet that they are; None for bytes that are no MQTT."""

    packet: Packet | None
    data: bytes


class Link:
    """Holds back what is not a whole packet yet, so that a packet can be judged before any of its bytes went on."""

    def __init__(self, direction: Direction, source: socket.socket, target: socket.socket) -> None:
        self.direction: Direction = direction
        self.source = source
        self.target = target
        self.reader = PacketReader()
        self.ended = False
        self._target_is_gone = False
        self._is_mqtt = True
        self._held = bytearray()
        self._queue: deque[tuple[float, bytes]] = deque()
        self._queued = 0

    @property
    def wants_more(self) -> bool:
        """Return whether the source is read: not past its end, nor for a target that is gone or has too much to take already."""
        return not self.ended and not self._target_is_gone and self._queued < BUFFER_BYTES_MAX

    @property
    def due_s(self) -> float | None:
        """When the first waiting bytes go out (monotonic seconds); None where nothing waits."""
        return self._queue[0][0] if self._queue else None

    @property
    def last_due_s(self) -> float:
        """When the last waiting bytes go out; 0 where nothing waits."""
        return self._queue[-1][0] if self._queue else 0.0

    def take(self, data: bytes) -> list[Piece]:
        """The packets that are whole with `data`; what is no MQTT passes untouched, for the broker to answer it."""
        self._held += data
        packets: list[Packet] = []
        if self._is_mqtt:
            try:
                packets = self.reader.feed(data)
            except MalformedPacketError:
                self._is_mqtt = False
        pieces = [Piece(packet, self._release(packet.size)) for packet in packets]
        return pieces if self._is_mqtt else [*pieces, *self.rest()]

    def rest(self) -> list[Piece]:
        """Return what is held back: the beginning of a packet that will never be whole."""
        return [Piece(None, self._release(len(self._held)))] if self._held else []

    def _release(self, count: int) -> bytes:
        data = bytes(self._held[:count])
        del self._held[:count]
        return data

    def send_later(self, data: bytes, due_s: float) -> None:
        """Queue bytes for the target."""
        if data and not self._target_is_gone:
            self._queue.append((due_s, data))
            self._queued += len(data)

    def send_due(self) -> None:
        """Give the target what is due, as far as it takes it.

        A target that is gone may have said its last words before: they are still to be read by the link of the other direction.
        """
        now_s = time.monotonic()
        while self._queue and self._queue[0][0] <= now_s:
            due_s, data = self._queue.popleft()
            try:
                sent = self.target.send(data)
            except BlockingIOError:
                sent = 0
            except OSError:
                self._target_is_gone = True
                self._queue.clear()
                return
            self._queued -= sent
            if sent < len(data):
                self._queue.appendleft((due_s, data[sent:]))
                return
