"""The meaning of one subscription's notifications: which values are the state as found, and where something is missing.

Holes are found by themselves: a sequence number that is left out, a queue that ran over (the status of a value says so), a server
that was silent for longer than it may be. How much was lost cannot be known; the most that it can have been is what could have
been sampled in that time. Pure: no clock, no I/O.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import ceil
from typing import NamedTuple

from edge.controls.opcua.event import EVENT, Event, Kind
from edge.sweep import Fact, Hole

SEQUENCE_MAX = 2**32 - 1
OPENING_S_MAX = 3.0  # so long the state as found waits for a value of each item


class Notification(NamedTuple):
    """One answer to a publish request. A keep-alive has no facts, and the number of the notification that comes next."""

    sequence: int
    facts: tuple[Fact, ...] = ()
    overflowed: tuple[str, ...] = ()
    is_keep_alive: bool = False


class Load(NamedTuple):
    """The content of one frame."""

    facts: tuple[Fact, ...]
    holes: tuple[Hole, ...] = ()


@dataclass(slots=True)
class Delivery:
    """One subscription from its creation on.

    items: the keys that it watches; sampled_ms: how often each is sampled at most, 0 = not known, then `queue_size` in each
    `publishing_ms` is the most that can be lost; faults: keys that cannot be watched, with the reason
    outage: the hole before this subscription, without its end; None where it is the first one
    awaits_refresh: the alarms that are there were asked for, and belong to the state as found
    began_ms, now_ms: the edge's calendar, which holes are stated in; began_s, at_s: its monotonic clock, for silence
    """

    items: frozenset[str]
    publishing_ms: float
    sampled_ms: float
    queue_size: int
    silent_s_max: float
    began_ms: int
    began_s: float
    faults: tuple[Fact, ...] = ()
    outage: tuple[str, int] | None = None
    awaits_refresh: bool = False
    heard_ms: int = 0
    heard_s: float = 0.0
    _next: int = 1
    _opening: dict[str, Fact] | None = field(default_factory=dict)
    _later: list[Fact] = field(default_factory=list)
    _events: list[Fact] = field(default_factory=list)
    _pending: list[Hole] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.heard_ms, self.heard_s = self.began_ms, self.began_s

    def take(self, told: Notification, now_ms: int, at_s: float) -> list[Load]:
        """Return what to hand on after this notification."""
        holes = [*self._silence(now_ms, at_s), *self._missing(told, now_ms), *self._overflows(told, now_ms)]
        self.heard_ms, self.heard_s = now_ms, at_s
        if self._opening is None:
            return [Load(told.facts, tuple(holes))] if told.facts or holes else []
        self._pending += holes
        for fact in told.facts:
            if fact.key == EVENT:
                self._events.append(fact)
                self.awaits_refresh &= Event.kind_of(fact) is not Kind.REFRESH_END
            elif fact.key in self._opening:
                self._later.append(fact)
            else:
                self._opening[fact.key] = fact
        return self.tick(now_ms, at_s)

    def tick(self, now_ms: int, at_s: float) -> list[Load]:
        """The state as found, once it is whole or has waited long enough; nothing later on."""
        if self._opening is None:
            return []
        is_whole = len(self._opening) >= len(self.items) and not self.awaits_refresh
        if not is_whole and at_s - self.began_s < OPENING_S_MAX:
            return []
        outage = [] if self.outage is None else [self.hole(*self.outage, now_ms)]
        loads = [Load((*self.faults, *self._opening.values(), *self._events), (*outage, *self._pending))]
        if self._later:
            loads.append(Load(tuple(self._later)))
        self._opening, self._later, self._pending, self._events = None, [], [], []
        return loads

    @property
    def is_open(self) -> bool:
        """Return whether the state as found has been handed on."""
        return self._opening is None

    def hole(self, reason: str, from_ms: int, to_ms: int, items: int | None = None) -> Hole:
        """A hole in the values of so many items (None: all), with the most that can have been lost."""
        to_ms = max(to_ms, from_ms)
        return Hole(reason, from_ms, to_ms, (len(self.items) if items is None else items) * self._looks(to_ms - from_ms))

    def _looks(self, milliseconds: int) -> int:
        if self.sampled_ms > 0:
            return ceil(milliseconds / self.sampled_ms) + 1
        return (ceil(milliseconds / self.publishing_ms) + 1) * self.queue_size

    def _silence(self, now_ms: int, at_s: float) -> Iterable[Hole]:
        if at_s - self.heard_s > self.silent_s_max:
            yield self.hole("the server was silent", self.heard_ms, now_ms)

    def _missing(self, told: Notification, now_ms: int) -> Iterable[Hole]:
        """A keep-alive tells the next number without using it up (part 4, 5.14.1.1); numbers start at 1, again after 2^32 - 1."""
        missed = told.sequence - self._next
        if not told.is_keep_alive or missed > 0:
            self._next = told.sequence if told.is_keep_alive else (1 if told.sequence == SEQUENCE_MAX else told.sequence + 1)
        if missed > 0:
            yield self.hole(f"{missed} notifications missing", self.heard_ms, now_ms)

    def _overflows(self, told: Notification, now_ms: int) -> Iterable[Hole]:
        if told.overflowed:
            names = ", ".join(sorted(set(told.overflowed))[:5])
            yield self.hole(f"queue of the server ran over: {names}", self.heard_ms, now_ms, len(set(told.overflowed)))
