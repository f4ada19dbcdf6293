"""One subscription: what is monitored, and the updates that wait for its client in numbered batches. No I/O; time is an argument.

    put ──▸ batch n ──▸ returned by sync ──▸ removed when the client acknowledges n (or at once, where they are streamed)

What overflows is dropped oldest first. The numbers of dropped batches are missing then, and sync says so until the client has
acknowledged something newer.
"""

import asyncio
import json
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from cnctwin.api.i3x.elements import machine_id, place_of
from cnctwin.api.i3x.vqt import Vqt, rfc3339

UPDATES_MAX = 5_000
BATCH_MAX = 500
MONITORED_MAX = 1_000
CLEAR = -1
"""The `lastSequenceNumber` that acknowledges everything."""


class Owner(NamedTuple):
    """The client that a subscription belongs to: the name that it gave itself, and the user that it is logged in as."""

    client_id: str
    user: str | None


class Update(NamedTuple):
    """A new value of an object."""

    element_id: str
    vqt: Vqt

    def as_json(self) -> dict[str, Any]:
        """Return it as the interface gives it."""
        value, quality, t_ms = self.vqt
        return {"elementId": self.element_id, "value": value, "quality": quality, "timestamp": rfc3339(t_ms)}


class Monitored(NamedTuple):
    """A registered object: its machine ("" = the plant) and how deep it is followed."""

    machine: str
    max_depth: int


class Numbered(NamedTuple):
    """Updates that came together, with their number."""

    sequence: int
    updates: Sequence[Update]


class Subscription:
    """A subscription, with what waits for its client. It belongs to the event loop."""

    def __init__(self, subscription_id: str, owner: Owner, display_name: str, client: str, now_s: float) -> None:
        self.id, self.owner, self.display_name, self.client = subscription_id, owner, display_name, client
        self.monitored: dict[str, Monitored] = {}
        self.machines: Counter[str] = Counter()
        """Return the number of monitored objects of each machine ("" = the plant)."""
        self.used_s = now_s
        self.stream: Stream | None = None
        self._batches: deque[Numbered] = deque()
        self._waiting = 0
        self._newest = self._returned = self._acknowledged = self._dropped = 0

    def monitor(self, element_id: str, monitored: Monitored) -> None:
        """Monitor an object that is not monitored yet."""
        self.monitored[element_id] = monitored
        self.machines[monitored.machine] += 1

    def forget(self, element_id: str) -> bool:
        """Monitor an object no longer; return True if it was."""
        if (known := self.monitored.pop(element_id, None)) is None:
            return False
        self.machines[known.machine] -= 1
        if not self.machines[known.machine]:
            del self.machines[known.machine]
        return True

    def monitors(self, element_id: str) -> bool:
        """Return True if a change of this object is to be told: it is registered, or a machine is with all its signals."""
        if element_id in self.monitored:
            return True
        place = place_of(element_id)
        whole = None if place is None else self.monitored.get(machine_id(place.machine))
        return whole is not None and whole.max_depth != 1

    def put(self, updates: Sequence[Update]) -> int:
        """Queue updates that came together; return how many older ones had to make room."""
        before = self._waiting + len(updates)
        for start in range(0, len(updates), BATCH_MAX):
            self._newest += 1
            self._batches.append(Numbered(self._newest, updates[start : start + BATCH_MAX]))
        self._waiting += len(updates)
        while self._waiting > UPDATES_MAX:
            self._dropped = self._remove().sequence
        if self.stream is not None and updates:
            self.stream.wake()
        return before - self._waiting

    def acknowledge(self, last: int | None) -> None:
        """Forget what the client has. A number that it cannot have been given changes nothing."""
        if last == CLEAR:
            last = self._returned = self._newest
        if last is None or not 0 <= last <= self._returned:
            return
        self._acknowledged = max(self._acknowledged, last)
        while self._batches and self._batches[0].sequence <= last:
            self._remove()

    def pending(self) -> list[Numbered]:
        """Return what waits, and keep it until it is acknowledged."""
        self._returned = self._newest
        return list(self._batches)

    @property
    def has_lost(self) -> bool:
        """True if updates were dropped that came after what the client has acknowledged."""
        return self._dropped > self._acknowledged

    def take(self) -> Numbered | None:
        """Return the oldest batch for a stream, which acknowledges nothing; None where there is none."""
        if not self._batches:
            return None
        batch = self._remove()
        self._returned = self._acknowledged = max(self._returned, batch.sequence)
        return batch

    def _remove(self) -> Numbered:
        batch = self._batches.popleft()
        self._waiting -= len(batch.updates)
        return batch

    def as_json(self) -> Mapping[str, Any]:
        """Return it as `/subscriptions/list` does."""
        monitored = [{"elementId": element_id, "maxDepth": one.max_depth} for element_id, one in self.monitored.items()]
        return {"subscriptionId": self.id, "displayName": self.display_name, "monitoredObjects": monitored}


class Stream:
    """An open stream over a subscription. The one that is opened next ends it."""

    def __init__(self, subscription: Subscription) -> None:
        self._subscription = subscription
        self._is_over = False
        self._news = asyncio.Event()

    def wake(self) -> None:
        """Have it look for updates."""
        self._news.set()

    def end(self) -> None:
        """Have it end, without an error."""
        self._is_over = True
        self.wake()

    async def following(self) -> bytes | None:
        """Wait for a batch; return it as a server-sent event, None at the end."""
        while not self._is_over:
            if (batch := self._subscription.take()) is not None:
                updates = [update.as_json() for update in batch.updates]
                return b"data: %s\n\n" % json.dumps(updates, separators=(",", ":"), allow_nan=False).encode()
            self._news.clear()
            await self._news.wait()
        return None
