"""The fold of `production` over a store: the same engine, given each message as it was received.

What held when the stretch began is the last sample of each signal before it. Time in which the memory itself heard nothing (its
process was away) is unknown: the machine is taken to be offline from the last message on until its next birth.

What an edge kept while the broker could not be reached, and sent late, is folded at its own time, which no live processor can do:
from the first late value on the machine is known again, until its edge is back.
"""

import heapq
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from cnctwin.memory.descriptions import Described, described
from cnctwin.memory.store.contract import Query, Store
from processors.actions import Action, Publish
from processors.config import Configuration
from processors.description import Role
from processors.production.config import Config
from processors.production.given import Given
from processors.production.processor import PROCESSOR, settled
from processors.production.record import shift_record
from processors.running.engine import Engine
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from twin.vocabulary.nodes import HISTORIAN_NODE, is_twin_node
from twin.vocabulary.twin_signals import PRODUCTION

DAY_MS = 86_400_000
POLL_S = 0.025  # a worker looks for silence every 50 ms
LATE_MAX = 500_000  # late messages of a stretch; what is beyond is left out
_INPUTS: Collection[str] = PROCESSOR.inputs or frozenset()
NOT_KNOWN = "not known when the stretch began"


def folded(store: Store, machine: str, from_ms: int, to_ms: int, table: Mapping[str, Any] | None = None) -> list[str]:
    """Return the records of a machine's shifts and parts in [from_ms, to_ms), that of the last shift as far as it has come.

    The fold begins with the shift that holds `from_ms`. table: the configuration of `production`. Raises StoreError,
    ConfigurationError.
    """
    configuration = PROCESSOR.configured(table)
    begin_ms = round(1000 * Given(configuration).slot(machine, from_ms / 1000).begin_s)
    return _Folding(store, machine, max(begin_ms, 0), to_ms, configuration).records()


class _Folding:
    """One run over the log of one machine."""

    def __init__(self, store: Store, machine: str, from_ms: int, to_ms: int, configuration: Configuration[Config]) -> None:
        self._store, self._machine, self._from_ms, self._to_ms = store, machine, from_ms, to_ms
        self._configuration = configuration
        self._engine = Engine(PROCESSOR, configuration)
        self._alive: dict[NodeId, None] = {}
        self._known_late: set[NodeId] = set()  # alive by what they sent late only
        self._last: dict[NodeId, dict[str, Reading]] = {}
        self._heard_ms = from_ms
        self._descriptions = deque(
            one for one in described(store, machine, from_ms, to_ms) if one.role is Role.LIVE and one.message is not None
        )
        self._told: list[str] = []

    def records(self) -> list[str]:
        """Run, and return what came of it."""
        self._describe(self._from_ms)
        gap_ms = round(1000 * self._configuration.of(self._machine).gap_s_max)
        for event in _births_before(self._store, self._machine, self._from_ms, gap_ms):
            self._feed(self._from_ms, event)
        last_ms = self._from_ms
        for at_ms, event, is_late in self._in_order():
            self._describe(at_ms)
            last_ms = at_ms
            if event.node.node == HISTORIAN_NODE:
                if event.kind is EventKind.HOLE:
                    self._bury()
            elif not is_twin_node(event.node.node):
                self._silence(at_ms)
                if is_late:
                    self._feed_late(at_ms, event)
                else:
                    self._feed(at_ms, event)
        newest_ms = max((one.last_us // 1000 for one in self._store.series(self._machine)), default=0)
        self._silence(min(max(newest_ms, last_ms), self._to_ms))  # beyond the newest sample nobody can tell
        lane = self._engine.lane_of(self._machine)
        tally = None if lane is None else settled(lane.state).tally
        if tally is not None and not tally.is_empty:
            share = self._configuration.default.known_share_min
            zone = Given(self._configuration).time_zone
            self._told.append(shift_record(self._machine, tally, share, zone, is_over=False))
        return self._told

    def _in_order(self) -> Iterator[tuple[int, HostEvent, bool]]:
        """Yield messages by when they were received, and among them what was sent late by when it was so."""
        late: list[tuple[int, HostEvent, bool]] = []
        for _, event in self._store.messages(self._machine, self._from_ms, self._to_ms):
            if _is_late(event) and len(late) < LATE_MAX:
                late.append((max(reading.timestamp_ms for reading in event.readings), _in_time(event), True))
        late.sort(key=lambda one: one[0])
        log = self._store.messages(self._machine, self._from_ms, self._to_ms)
        live = ((received_ms, event, False) for received_ms, event in log if not _is_late(event))
        yield from heapq.merge(live, late, key=lambda one: one[0])

    def _describe(self, at_ms: int) -> None:
        while self._descriptions and self._descriptions[0].received_ms <= at_ms:
            one: Described = self._descriptions.popleft()
            self._took(self._engine.describe(self._machine, Role.LIVE, one.description))

    def _feed(self, received_ms: int, event: HostEvent) -> None:
        if event.kind is EventKind.BIRTH:
            self._alive[event.node] = None
            self._known_late.discard(event.node)
            self._last[event.node] = {}
        elif event.kind is EventKind.DEATH:
            self._alive.pop(event.node, None)
            self._known_late.discard(event.node)
        elif event.kind is EventKind.DATA and event.node not in self._alive:
            names = [one.signal for one in self._store.series(self._machine) if one.node in (event.node.node, str(event.node))]
            nulls = tuple(Reading(name, None, event.timestamp_ms, Quality.BAD, None, NOT_KNOWN, False) for name in names)
            self._feed(received_ms, event._replace(kind=EventKind.BIRTH, readings=nulls, names=()))
        self._heard_ms = received_ms
        if event.kind in (EventKind.BIRTH, EventKind.DATA):
            self._remember(event)
        self._took(self._engine.feed(event, received_ms / 1000))

    def _feed_late(self, at_ms: int, event: HostEvent) -> None:
        """Feed what was sent late, where the machine was offline; while it was not, what was sent in time tells it already."""
        node = event.node
        if node in self._known_late:
            self._feed(at_ms, event)
            return
        self._remember(event)
        if node not in self._alive:
            readings = tuple(one._replace(timestamp_ms=at_ms) for one in self._last[node].values())
            self._feed(at_ms, event._replace(kind=EventKind.BIRTH, readings=readings, names=()))
            self._known_late.add(node)

    def _remember(self, event: HostEvent) -> None:
        known = self._last.setdefault(event.node, {})
        known.update((one.name, one) for one in event.readings if one.name in _INPUTS)

    def _bury(self) -> None:
        """The memory was away: nobody knows how the machine was meanwhile."""
        for node in tuple(self._alive):
            self._feed(self._heard_ms, HostEvent(EventKind.DEATH, node, self._machine, self._heard_ms, (), "not in the store"))

    def _silence(self, at_ms: int) -> None:
        self._took(self._engine.silence(at_ms / 1000 - POLL_S))

    def _took(self, actions: Sequence[Action]) -> None:
        for action in actions:
            if isinstance(action, Publish) and action.machine == self._machine:
                self._told += [
                    change.value
                    for change in action.changes
                    if change.name == PRODUCTION and not change.is_historical and isinstance(change.value, str)
                ]


def _is_late(event: HostEvent) -> bool:
    """Return True for data that an edge had to keep for a while."""
    return event.kind is EventKind.DATA and bool(event.readings) and all(one.is_historical for one in event.readings)


def _in_time(event: HostEvent) -> HostEvent:
    """Return the message as if it had been sent in time."""
    return event._replace(readings=tuple(one._replace(is_historical=False) for one in event.readings), names=())


def _births_before(store: Store, machine: str, from_ms: int, gap_ms: int) -> Iterator[HostEvent]:
    """Yield a birth for each edge that was heard of late when the stretch began, with the last values of the day before it."""
    alive: dict[NodeId, None] = {}
    for _, event in store.messages(machine, from_ms - gap_ms, from_ms):
        if event.kind is EventKind.HOLE and event.node.node == HISTORIAN_NODE:
            alive.clear()
        elif event.kind is EventKind.DEATH:
            alive.pop(event.node, None)
        elif event.kind in (EventKind.BIRTH, EventKind.DATA) and not is_twin_node(event.node.node):
            alive[event.node] = None
    series = store.series(machine)
    for node in alive:
        asked = tuple(sorted({one.signal for one in series if one.node in (node.node, str(node)) and one.signal in _INPUTS}))
        columns = store.query(Query(machine, asked, from_ms - DAY_MS, from_ms)) if asked else []
        readings = tuple(
            Reading(one.signal, one.value[-1], from_ms, one.quality[-1], one.unit, one.reason[-1], False)
            for one in columns
            if one.t_us
        )
        yield HostEvent(EventKind.BIRTH, node, machine, from_ms, readings)
