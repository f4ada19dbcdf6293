"""All subscriptions: who owns which, what they are told of the plant, and when an abandoned one is deleted.

Everything here runs in the event loop but `send`, which the thread that feeds the plant calls.
"""

import asyncio
import secrets
from collections.abc import Callable, Iterator, Sequence
from time import monotonic
from typing import NamedTuple

from cnctwin.api.errors import ApiError
from cnctwin.api.fleet import SHOWN
from cnctwin.api.i3x.elements import PLANT_ID, machine_id, signal_id
from cnctwin.api.i3x.space import Element, Space
from cnctwin.api.i3x.subscription import MONITORED_MAX, Monitored, Owner, Stream, Subscription, Update
from cnctwin.api.i3x.types import type_of
from cnctwin.api.i3x.vqt import Vqt, vqt
from cnctwin.api.live.batches import Batch, Row
from cnctwin.api.value_object import QUALITY_NAMES

SUBSCRIPTIONS_MAX = 64
OF_ONE_MAX = 16
TTL_S = 300.0
_SHOWN = frozenset(SHOWN.values())


class Present(NamedTuple):
    """An object that is to be monitored, with its present value and, where it is followed deeper, those of its components.

    is_whole: the plant or a machine, of whose value only a change is told
    """

    element_id: str
    machine: str
    is_whole: bool
    updates: tuple[Update, ...]


def presents(space: Space, element_ids: list[str], max_depth: int) -> list[Present | None]:
    """Return the objects of these ids as they are now, None for each that there is not; it may take a moment."""
    return [None if one is None else _present(one, max_depth) for one in space.find(element_ids)]


def _present(one: Element, max_depth: int) -> Present:
    below = one.components() if max_depth != 1 else {}
    updates = (Update(one.element_id, one.value()), *(Update(*component) for component in below.items()))
    return Present(one.element_id, one.place.machine, not one.place.signal, updates)


class Subscriptions:
    """The subscriptions of all clients over one address space."""

    def __init__(self, space: Space, clock: Callable[[], float] = monotonic) -> None:
        self.dropped = 0
        self._space, self._live, self._clock = space, space.live, clock
        self._held: dict[str, Subscription] = {}
        self._watched: frozenset[str | None] = frozenset()
        self._last: dict[str, Vqt] = {}
        """The last value of the plant and of each watched machine, so that only a change is told."""
        self._loop: asyncio.AbstractEventLoop | None = None

    def __len__(self) -> int:
        return len(self._held)

    def attach(self, loop: asyncio.AbstractEventLoop) -> None:
        """Name the loop that everything here runs in."""
        self._loop = loop

    def send(self, batches: Sequence[Batch]) -> None:
        """Hand what has changed to the loop; from any thread."""
        if self._held and self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self.deliver, batches)

    def end(self) -> None:
        """End all streams: the server stops."""
        self._loop = None
        for subscription in self._held.values():
            if subscription.stream is not None:
                subscription.stream.end()

    # What a client asks.

    def create(self, owner: Owner, display_name: str, client: str) -> Subscription:
        """Return a new subscription. Raises ApiError where there are too many, or too many from this address."""
        self._expire()
        if len(self._held) >= SUBSCRIPTIONS_MAX:
            raise ApiError(503, f"there are {SUBSCRIPTIONS_MAX} subscriptions, which is the limit; delete one")
        if sum(one.client == client for one in self._held.values()) >= OF_ONE_MAX:
            raise ApiError(503, f"{client} has {OF_ONE_MAX} subscriptions, which is the limit; delete one")
        made = Subscription(secrets.token_urlsafe(32), owner, display_name, client, self._clock())
        self._held[made.id] = made
        return made

    def find(self, subscription_id: str, owner: Owner) -> Subscription | None:
        """Return a subscription; None where there is none, or where it belongs to somebody else."""
        self._expire()
        found = self._held.get(subscription_id)
        return found if found is not None and found.owner == owner else None

    def delete(self, subscription: Subscription) -> None:
        """Forget a subscription and end its stream."""
        del self._held[subscription.id]
        if subscription.stream is not None:
            subscription.stream.end()
        self._watch()

    def register(self, subscription: Subscription, found: Sequence[Present | None], max_depth: int) -> list[bool]:
        """Monitor objects, and queue their present values; return which of them there are. Raises ApiError at the limit."""
        known = subscription.monitored
        new = {one.element_id: one for one in found if one is not None and one.element_id not in known}.values()
        if len(known) + len(new) > MONITORED_MAX:
            raise ApiError(400, f"a subscription monitors at most {MONITORED_MAX} objects; register a machine with maxDepth 0")
        for one in new:
            subscription.monitor(one.element_id, Monitored(one.machine, max_depth))
            if one.is_whole:
                self._last.setdefault(one.element_id, one.updates[0].vqt)
        self._watch()
        self.dropped += subscription.put([update for one in new for update in one.updates])
        return [one is not None for one in found]

    def unregister(self, subscription: Subscription, element_ids: Sequence[str]) -> list[bool]:
        """Monitor objects no longer; return which of them were monitored. What waits already stays."""
        known = [subscription.forget(one) for one in element_ids]
        self._watch()
        return known

    def open(self, subscription: Subscription) -> Stream:
        """Open a stream; one that is open ends."""
        if subscription.stream is not None:
            subscription.stream.end()
        subscription.stream = Stream(subscription)
        return subscription.stream

    def close(self, subscription: Subscription, stream: Stream) -> None:
        """Take note that a stream has ended."""
        if subscription.stream is stream:
            subscription.stream = None
        self.used(subscription)

    def used(self, subscription: Subscription) -> None:
        """Take note that the client has asked for updates: the time after which it counts as abandoned begins again."""
        subscription.used_s = self._clock()

    # What the plant tells.

    def deliver(self, batches: Sequence[Batch]) -> None:
        """Queue what has changed for each subscription that monitors it."""
        self._expire()
        changes: dict[str, list[Update]] = {}
        for machine, _, rows in batches:
            if machine is not None and machine in self._watched and (rows is None or rows):
                changes.setdefault(machine, []).extend(self._changes(machine, rows))
        if plant := list(self._plant_changes()):
            changes[""] = plant
        for subscription in self._held.values() if changes else ():
            told = [update for machine in changes.keys() & subscription.machines.keys() for update in changes[machine]]
            self.dropped += subscription.put([update for update in told if subscription.monitors(update.element_id)])

    def _changes(self, machine: str, rows: Sequence[Row] | None) -> Iterator[Update]:
        """Yield the new values of a machine's signals, then its own where that has changed too."""
        whole = self._space.machine(machine) if rows is None or any(row[1] in _SHOWN for row in rows) else None
        if rows is not None:
            for t_ms, name, value, quality, _ in rows:
                told = vqt(value, QUALITY_NAMES.get(quality, "bad"), t_ms, type_of(name))
                yield Update(signal_id(machine, name), told)
        elif whole is not None:
            yield from (Update(*one) for one in whole.components().items())
        if whole is not None and self._is_new(whole.element_id, whole.value()):
            yield Update(whole.element_id, self._last[whole.element_id])

    def _plant_changes(self) -> Iterator[Update]:
        if PLANT_ID in self._last and self._is_new(PLANT_ID, plant := self._space.plant().value()):
            yield Update(PLANT_ID, plant)

    def _is_new(self, element_id: str, value: Vqt) -> bool:
        last = self._last.get(element_id)
        self._last[element_id] = value
        return last is None or last[:2] != value[:2]

    # The upkeep.

    def _watch(self) -> None:
        """Have the live plant tell what the subscriptions monitor, and no more."""
        # The plant (None) is heard of as a reader of the fleet.
        wanted = frozenset(machine or None for held in self._held.values() for machine in held.machines)
        for machine in wanted - self._watched:
            self._live.watch(machine)
        for machine in self._watched - wanted:
            self._live.unwatch(machine)
        self._watched = wanted
        kept = {PLANT_ID if machine is None else machine_id(machine) for machine in wanted}
        self._last = {element_id: value for element_id, value in self._last.items() if element_id in kept}

    def _expire(self) -> None:
        """Delete what its client has abandoned."""
        oldest_s = self._clock() - TTL_S
        for one in [one for one in self._held.values() if one.stream is None and one.used_s < oldest_s]:
            self.delete(one)
