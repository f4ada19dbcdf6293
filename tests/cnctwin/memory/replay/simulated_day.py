"""A day in memory: edges, processors and a historian, each with a clock of its own, on a broker that keeps the order.

What a processor does is what `processors.running.worker.Worker` does, so far as it matters to the state: events as they come,
silence when none waits, a snapshot within two seconds; it may be killed at any moment and started again.
"""

from collections.abc import Iterable, Sequence
from random import Random

from cnctwin.memory.plain_record import PlainRecord
from cnctwin.memory.store.contract import Message, Snapshot
from processors.actions import Action, Declare, Publish, Remove
from processors.description import machine_and_role, read_message
from processors.discovery import AnyProcessor
from processors.running.engine import Engine
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Change, NodeId, Reading
from tests.cnctwin.memory.replay.memory_store import MemoryStore

T0_MS = 1_700_000_000_000
EDGE = NodeId("cnc", "edge-vmc")
SAVE_S = 2.0
POLL_S = 0.05


class Living:
    """One processor at work; `waiting` events are on their way to it."""

    def __init__(self, processor: AnyProcessor, table: dict[str, object], delay_s: float) -> None:
        self.processor, self._table, self.delay_s = processor, table, delay_s
        self.node = NodeId("cnc", processor.node)
        self.waiting: list[tuple[float, HostEvent]] = []
        self.snapshots: dict[str, bytes] = {}
        self.is_alive = False
        self.saved_s = 0.0
        self._heard: set[NodeId] = set()
        self._declared: dict[str, dict[str, Reading]] = {}

    def start(self, retained: Iterable[HostEvent] = ()) -> None:
        """Begin as a new process; it is told first what the broker has retained."""
        self.engine = Engine(self.processor, self.processor.configured(self._table))
        for event in retained:
            self._describe(event)
        self._heard, self._declared, self.waiting = set(), {}, []
        for payload in self.snapshots.values():
            self.engine.restore(payload)
        self.is_alive = True

    def kill(self, now_s: float) -> list[HostEvent]:
        """kill -9; what its will says."""
        self.is_alive = False
        at_ms = T0_MS + round(now_s * 1000)
        return [HostEvent(EventKind.DEATH, self.node, name, at_ms, (), "edge node offline") for name in self._declared]

    def turn(self, now_s: float) -> list[HostEvent]:
        """Return what it publishes in one round of its loop."""
        actions: list[Action] = []
        due = [event for at_s, event in self.waiting if at_s <= now_s]
        self.waiting = [(at_s, event) for at_s, event in self.waiting if at_s > now_s]
        for event in due:
            if event.kind is EventKind.PLAIN:
                actions += self._describe(event)
            if event.kind is EventKind.BIRTH:
                self._heard.add(event.node)
            if event.node in self._heard:
                actions += self.engine.feed(event, now_s)
        if not due:
            actions += self.engine.silence(now_s)
        if now_s - self.saved_s >= SAVE_S:
            self.saved_s = now_s
            self.snapshots |= {unit: self.engine.snapshot(unit) for unit in self.engine.units}
        return [event for action in actions for event in self._sent(action, T0_MS + round(now_s * 1000))]

    def _describe(self, event: HostEvent) -> list[Action]:
        found = machine_and_role(event.topic)
        assert found is not None
        description = read_message(event.payload, found[0]).description(found[0]) if event.payload else None
        return self.engine.describe(*found, description)

    def _sent(self, action: Action, at_ms: int) -> list[HostEvent]:
        if isinstance(action, Declare):
            self._declared[action.machine] = {change.name: _read(change) for change in action.latest}
            return [HostEvent(EventKind.BIRTH, self.node, action.machine, at_ms, tuple(map(_read, action.latest)))]
        if isinstance(action, Remove):
            del self._declared[action.machine]
            return [HostEvent(EventKind.DEATH, self.node, action.machine, at_ms, (), "device offline")]
        if isinstance(action, Publish) and action.machine in self._declared:
            return [HostEvent(EventKind.DATA, self.node, action.machine, at_ms, tuple(map(_read, action.changes)))]
        return []


def _read(change: Change) -> Reading:
    return Reading(change.name, change.value, change.timestamp_ms, change.quality, None, change.reason, change.is_historical)


class Day:
    """Events of edges by time, processors that live and die, and what a historian keeps of it."""

    def __init__(self, processors: Sequence[tuple[AnyProcessor, dict[str, object]]], seed: int = 1) -> None:
        self._chance = Random(seed)
        self.living = [Living(one, table, 0.01 * number) for number, (one, table) in enumerate(processors, start=1)]
        self.store = MemoryStore()
        self._kept_hours: set[tuple[str, str, int]] = set()
        self._retained: dict[str, HostEvent] = {}
        self._record = PlainRecord()

    def run(
        self, events: Sequence[tuple[float, HostEvent]], seconds: float, kills: Sequence[tuple[float, str, float]] = ()
    ) -> None:
        """`kills`: when, which processor, and after how many seconds it is started again. Processors begin at 0 s."""
        for one in self.living:
            one.start()
        births = {event.node: event for _, event in reversed(events) if event.kind is EventKind.BIRTH}
        waiting = sorted(events, key=lambda pair: pair[0])
        asked: list[float] = []
        for step in range(round(seconds / POLL_S)):
            now_s = step * POLL_S + self._chance.uniform(0.0, 0.04)
            while waiting and waiting[0][0] <= now_s:
                at_s, event = waiting.pop(0)
                self._on_the_broker(event, at_s)
                births |= {event.node: event} if event.kind is EventKind.BIRTH else {}
            for at_s, name, pause_s in kills:
                one = next(living for living in self.living if living.processor.name == name)
                if one.is_alive and at_s <= now_s < at_s + pause_s:
                    for death in one.kill(now_s):
                        self._on_the_broker(death, now_s)
                    for unit, payload in one.snapshots.items():
                        self.store.snapshots.append(Snapshot(name, unit, T0_MS + round(now_s * 1000) - 100, payload))
                elif not one.is_alive and now_s >= at_s + pause_s:
                    one.start(self._retained.values())
                    asked.append(now_s + 0.2)
            while asked and asked[0] <= now_s:  # what began again asks for births
                asked.pop(0)
                for birth in births.values():
                    self._on_the_broker(self._born_again(birth, waiting, now_s), now_s)
            for one in self.living:
                if one.is_alive:
                    for event in one.turn(now_s):
                        self._on_the_broker(event, now_s + 0.001)
                    self._keep_snapshots(one, now_s)

    def _on_the_broker(self, event: HostEvent, now_s: float) -> None:
        received_ms = T0_MS + round(now_s * 1000)
        if event.kind is EventKind.PLAIN:
            kept = self._record.hear(event, received_ms)
            assert kept is not None
            self.store.snapshots.append(kept)
            self._retained[event.topic] = event
        else:
            self.store.log.append(Message(self._record.moment(received_ms), event))
        for one in self.living:
            if one.is_alive and event.node != one.node:
                one.waiting.append((now_s + one.delay_s, event))

    def _born_again(self, birth: HostEvent, waiting: Sequence[tuple[float, HostEvent]], now_s: float) -> HostEvent:
        """The birth with what is true now."""
        row: dict[str, Reading] = {}
        for _, event in self.store.log:
            if event.node == birth.node and event.device == birth.device:
                row.update((reading.name, reading) for reading in event.readings)
        return birth._replace(timestamp_ms=T0_MS + round(now_s * 1000), readings=tuple(row.values()))

    def _keep_snapshots(self, one: Living, now_s: float) -> None:
        at_ms = T0_MS + round(now_s * 1000)
        for unit, payload in one.snapshots.items():
            key = one.processor.name, unit, at_ms // 60_000  # each minute: an hour would be long for a test
            if key not in self._kept_hours and one.saved_s == now_s:
                self._kept_hours.add(key)
                self.store.snapshots.append(Snapshot(one.processor.name, unit, at_ms + 2, payload))
