"""From one thread to many readers: each gets the same bytes, in a queue that is short; who does not read is let go.

Everything here runs in the event loop but `send`, which other threads call.
"""

import asyncio
from collections.abc import Sequence

from cnctwin.api.errors import ApiError
from cnctwin.api.live.batches import ALL, Batch
from cnctwin.api.live.plant import LivePlant

READERS_MAX = 64
OF_ONE_MAX = 32
BEHIND_MAX = 50  # messages, so 5 s at ten a second


class Reader:
    """One open stream: of a machine, or of the fleet (None), for a client."""

    def __init__(self, machine: str | None, client: str = "") -> None:
        self.machine = machine
        self.client = client
        self.messages: asyncio.Queue[bytes | None] = asyncio.Queue(BEHIND_MAX + 1)
        self.is_over = False

    def put(self, payload: bytes) -> bool:
        """Queue a message; False where the reader is too far behind, and is let go."""
        if self.messages.qsize() >= BEHIND_MAX:
            self.end()
            return False
        self.messages.put_nowait(payload)
        return True

    def end(self) -> None:
        """No more messages: what waits is thrown away, the stream ends, and the client begins again with a full state."""
        self.is_over = True
        while not self.messages.empty():
            self.messages.get_nowait()
        self.messages.put_nowait(None)


class FanOut:
    """All open streams."""

    def __init__(self, live: LivePlant, readers_max: int = READERS_MAX) -> None:
        self.dropped = 0
        self._live = live
        self._readers_max = readers_max
        self._readers: dict[str | None, set[Reader]] = {}
        self._loop: asyncio.AbstractEventLoop | None = None
        self._is_over = False

    def __len__(self) -> int:
        return sum(len(readers) for readers in self._readers.values())

    def attach(self, loop: asyncio.AbstractEventLoop) -> None:
        """The loop in which the streams are."""
        self._loop = loop

    def send(self, batches: Sequence[Batch]) -> None:
        """Hand batches to the loop; from any thread."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._deliver, batches)

    def open(self, machine: str | None, client: str = "") -> Reader:
        """One more stream. Raises ApiError where there are too many, or too many of this client."""
        if len(self) >= self._readers_max:
            raise ApiError(503, f"{self._readers_max} streams are open, which is the limit; close a page", {"Retry-After": "10"})
        if client and sum(one.client == client for group in self._readers.values() for one in group) >= OF_ONE_MAX:
            raise ApiError(
                503, f"{OF_ONE_MAX} streams of {client} are open, which is the limit; close a page", {"Retry-After": "10"}
            )
        reader = Reader(machine, client)
        self._readers.setdefault(machine, set()).add(reader)
        self._live.watch(machine)
        if self._is_over:
            reader.end()
        return reader

    def close(self, reader: Reader) -> None:
        """A stream has ended."""
        readers = self._readers.get(reader.machine, set())
        if reader in readers:
            readers.discard(reader)
            if not readers:
                del self._readers[reader.machine]
            self._live.unwatch(reader.machine)

    def end(self) -> None:
        """End all streams, and at once those that a request under way still opens: the server stops."""
        self._loop = None
        self._is_over = True
        for reader in [one for readers in self._readers.values() for one in readers]:
            reader.end()

    def _deliver(self, batches: Sequence[Batch]) -> None:
        for machine, payload, _ in batches:
            if machine == ALL:
                readers = [one for group in self._readers.values() for one in group]
            else:
                readers = list(self._readers.get(machine, ()))
            for reader in readers:
                if not reader.is_over and not reader.put(payload):
                    self.dropped += 1
