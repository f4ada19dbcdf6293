"""What passed through the proxy: every byte and every packet, with its time, connection and direction."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, overload

from tests.wire.link import Direction
from tests.wire.mqtt_packets import Packet

RECORDED_BYTES_MAX = 512 * 1024 * 1024
P = TypeVar("P", bound=Packet)


class Recorded(NamedTuple):
    """A packet as it arrived: when (monotonic seconds), on which connection (from 0), in which direction."""

    at_s: float
    connection: int
    direction: Direction
    packet: Packet


class Chunk(NamedTuple):
    """Bytes as they came off a socket."""

    at_s: float
    connection: int
    direction: Direction
    data: bytes


class Recording:
    """Written by the proxy's thread, read by the test."""

    def __init__(self) -> None:
        self._chunks: list[Chunk] = []
        self._packets: list[Recorded] = []
        self._bytes = 0
        self._changed = threading.Condition()

    def add_bytes(self, connection: int, direction: Direction, data: bytes) -> None:
        """Keep bytes as they arrived; raises OverflowError where a test records without end."""
        self._bytes += len(data)
        if self._bytes > RECORDED_BYTES_MAX:
            raise OverflowError(f"the proxy has recorded more than {RECORDED_BYTES_MAX} bytes")
        with self._changed:
            self._chunks.append(Chunk(time.monotonic(), connection, direction, data))

    def add_packet(self, connection: int, direction: Direction, packet: Packet) -> None:
        """Keep a packet and wake those who wait for it."""
        with self._changed:
            self._packets.append(Recorded(time.monotonic(), connection, direction, packet))
            self._changed.notify_all()

    @property
    def chunks(self) -> list[Chunk]:
        """Every byte, as it arrived."""
        with self._changed:
            return list(self._chunks)

    @property
    def recorded(self) -> list[Recorded]:
        """Every packet with its time, connection and direction."""
        with self._changed:
            return list(self._packets)

    def bytes_of(self, direction: Direction, connection: int | None = None) -> bytes:
        """All bytes of a direction, joined."""
        return b"".join(
            chunk.data for chunk in self.chunks if chunk.direction == direction and connection in {None, chunk.connection}
        )

    @overload
    def packets(self, direction: Direction | None = None, *, connection: int | None = None) -> list[Packet]: ...

    @overload
    def packets(self, direction: Direction | None, kind: type[P], *, connection: int | None = None) -> list[P]: ...

    def packets(
        self,
        direction: Direction | None = None,
        kind: type[Packet] = Packet,
        *,
        connection: int | None = None,
    ) -> list[Any]:
        """The packets of a direction ("up" is towards the broker), of a kind, of a connection, in order."""
        return [
            seen.packet
            for seen in self.recorded
            if direction in {None, seen.direction} and connection in {None, seen.connection} and isinstance(seen.packet, kind)
        ]

    def wait_for(
        self, matches: Callable[[Packet], bool], *, timeout_s: float = 60.0, count: int = 1, after: int = 0
    ) -> list[Recorded]:
        """The first `count` packets that match, past the first `after` packets; raises TimeoutError."""
        deadline = time.monotonic() + timeout_s
        with self._changed:
            while True:
                found = [seen for seen in self._packets[after:] if matches(seen.packet)]
                if len(found) >= count:
                    return found[:count]
                if not self._changed.wait(deadline - time.monotonic()):
                    kinds = ", ".join(type(seen.packet).__name__ for seen in self._packets[-20:])
                    raise TimeoutError(f"{len(found)} of {count} packets in {timeout_s} s; the last ones: {kinds}")
