"""One processor over the log again: the same engine, given what it was given then.

Its clock on the wall is the time at which each message was received. Before each message come the ticks that silence had brought
by then; a beat of a second comes where the day shows one (what was published at a beat carries its time), else at each second.
"""

from collections import deque
from collections.abc import Collection, Mapping, Sequence

from cnctwin.memory.descriptions import Described
from cnctwin.memory.replay.comparison import Comparison, as_sent
from cnctwin.memory.replay.lives import Restart, Start, births_of, versions_of
from cnctwin.memory.replay.log import is_twin
from processors.actions import Action, DeadLetter, Declare, Publish, Remove
from processors.config import Configuration, ProcessorConfig
from processors.contract import OutputSpec
from processors.description import Role
from processors.discovery import AnyProcessor
from processors.errors import SnapshotError
from processors.running.challenger import challenger_specs
from processors.running.engine import Engine
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Change, NodeId, Reading
from sparkplug.quality import Quality
from twin.vocabulary.nodes import HISTORIAN_NODE

POLL_S = 0.025  # a worker looks for silence every 50 ms
SETTLED_MS = 1000
BEAT_MS = 1000
QUICKER_MS = 500
NOT_KNOWN = "not known at the start of the replay"


class Rerun:
    """See the module.

    machine, machines: the one that is compared, and all of its unit
    names: of the signals, by machine and node
    fed: nodes of processors whose recomputed values are fed to it, in place of what the log has
    is_chained: whether what it gives is to be fed to others
    described: the descriptions of its machines, in order
    """

    def __init__(  # noqa: PLR0917
        self,
        processor: AnyProcessor,
        configuration: Configuration[ProcessorConfig],
        machine: str,
        machines: Collection[str],
        start: Start,
        restarts: Mapping[int, Restart],
        names: Mapping[str, Mapping[NodeId, Sequence[str]]],
        comparison: Comparison,
        *,
        fed: Collection[str] = (),
        is_chained: bool = False,
        described: Sequence[Described] = (),
    ) -> None:
        self.processor, self._configuration, self._machine, self._machines = processor, configuration, machine, machines
        self.start, self._restarts, self._names = start, restarts, names
        self._fed, self._is_chained = fed, is_chained
        self.comparison = comparison
        self.dead_letters = self.restarts = 0
        self.notes: list[str] = []
        self._engine = Engine(processor, configuration)
        self._to_come = deque(described)
        self._describes: dict[tuple[str, Role], Described] = {}
        self._declared: set[str] = set()
        self._heard: set[tuple[NodeId, str | None]] | None = set() if start.is_birth else None
        self._known: set[tuple[NodeId, str | None]] = set()
        self._window: list[tuple[int, HostEvent | Described]] | None = None if start.snapshots is None else []
        self._snapshots: Mapping[str, bytes] = {}
        self._hears_from = start.hears_from
        self._births, self._saved_ms = start.births, start.saved_ms
        self._early: list[tuple[int, HostEvent]] = []
        self._wall_s = self._said_s = 0.0
        self._beats = processor.beats
        self._beat_ms: int | None = None
        self._is_counted = False
        self._produced: list[HostEvent] = []
        self._types = {spec.name: (spec.datatype, spec.unit) for spec in outputs_of(processor)}
        while self._to_come and self._to_come[0].received_ms <= start.from_ms:
            self._describe(self._to_come.popleft())

    def take(self, place: int, received_ms: int, event: HostEvent, *, is_counted: bool) -> list[HostEvent]:
        """One message of the log, or of another processor that is run again; what came of it, as other processors see it."""
        self._produced = []
        if received_ms < self.start.from_ms or not self._is_of_unit(event):
            return []
        self._is_counted = is_counted
        while self._to_come and self._to_come[0].received_ms <= received_ms:
            self._hear_description(self._to_come.popleft())
        if event.node.node == self.processor.node:
            self._own(place, received_ms, event)
        elif event.node.node in self._fed or event.node.node == HISTORIAN_NODE:
            pass
        elif not self._births and place < self._hears_from.get(event.device or "", 0):
            self._missed(received_ms, event)
        elif self._window is not None and received_ms <= self.start.received_ms + SETTLED_MS:
            self._window.append((received_ms, event))
        else:
            self._resume()
            early, self._early = self._early, []
            for early_ms, quicker in early:
                if early_ms >= received_ms - QUICKER_MS:
                    self._feed(early_ms, quicker)
            self._feed(received_ms, event)
        return self._produced

    def chained(self, received_ms: int, event: HostEvent, *, is_counted: bool) -> list[HostEvent]:
        """Return what another processor, run again, has just said."""
        self._produced = []
        self._is_counted = is_counted
        if event.node.node in self._fed and self._window is None and event.device in self._machines:
            self._feed(received_ms, event)
        return self._produced

    def end(self) -> None:
        """The stretch is over. It had lived until it said its last: the ticks of the silence before that were given."""
        self._resume()
        self._wall_s = max(self._wall_s, self._said_s + POLL_S)
        self._silence()

    def _is_of_unit(self, event: HostEvent) -> bool:
        return event.device is None or event.device in self._machines

    # What it published then.

    def _own(self, place: int, received_ms: int, event: HostEvent) -> None:
        if event.kind is EventKind.DATA:
            self._said_s = received_ms / 1000
            if self._beats and event.readings:
                self._beat(max(reading.timestamp_ms for reading in event.readings))
            if event.device == self._machine:
                self.comparison.published([one for one in event.readings if one.name in self._types], is_counted=self._is_counted)
        elif event.kind is EventKind.BIRTH and event.device == self._machine:
            self.comparison.restated([one for one in event.readings if one.name in self._types])
        elif event.kind is EventKind.DEATH and place in self._restarts:
            self._wall_s = max(self._wall_s, received_ms / 1000)
            self._silence()
            self._restart(self._restarts[place])

    def _restart(self, restart: Restart) -> None:
        self.restarts += 1
        self.comparison.cut_off()
        self._hears_from, self._births, self._saved_ms = restart.hears_from, restart.births, restart.saved_ms
        snapshots = {unit: restart.snapshots.get(unit) or self._saved(unit) for unit in restart.units}
        self._engine = Engine(self.processor, self._configuration)
        for described in self._describes.values():
            self._describe(described)
        self._declared.clear()
        self._heard = set()
        self._beat_ms = None
        for payload in snapshots.values():
            if payload is not None:
                self._restored(payload, is_resumed=False)

    def _saved(self, unit: str) -> bytes | None:
        try:
            return self._engine.snapshot(unit)
        except KeyError:
            return None

    def _restored(self, payload: bytes, *, is_resumed: bool) -> None:
        try:
            unit = self._engine.resume(payload, self._names) if is_resumed else self._engine.restore(payload)
        except SnapshotError as error:
            self.notes.append(f"a snapshot cannot be restored, the state starts fresh: {error}")
            return
        lane = self._engine.lane_of(self._machine)
        if unit and lane is not None:
            self.comparison.known(lane.emission.latest)
            if is_resumed and lane.ticking:
                self._declared.add(self._machine)

    # What it was given.

    def _hear_description(self, described: Described) -> None:
        if self._window is not None:
            self._window.append((described.received_ms, described))
            return
        self._wall_s = max(self._wall_s, described.received_ms / 1000)
        self._silence()
        self._describe(described)

    def _describe(self, described: Described) -> None:
        """Give the engine a description, as the worker did then."""
        self._describes[described.machine, described.role] = described
        try:
            actions = self._engine.describe(described.machine, described.role, described.description)
        except Exception as error:  # as then: the one before goes on
            self.notes.append(f"description {described.version} is refused: {error}")
        else:
            self._took(actions)

    def _missed(self, received_ms: int, event: HostEvent) -> None:
        """It was not there yet; but other processors that were born in the last moment may have been quicker than the edge."""
        if is_twin(event):
            self._early = [one for one in self._early if one[0] >= received_ms - QUICKER_MS]
            self._early.append((received_ms, event))

    def _resume(self) -> None:
        """Go on from the snapshot, with the first message that it had not seen."""
        if self._window is None:
            return
        window, self._window = self._window, None
        late = self._described_at_the_snapshot(window)
        for payload in (self.start.snapshots or {}).values():
            self._restored(payload, is_resumed=True)
            if births := births_of(payload):
                nodes = {str(node): node for names in self._names.values() for node in names}
                heard: set[tuple[NodeId, str | None]] = {(nodes[node], machine) for machine, node in births if node in nodes}
                self._heard = heard if self._heard is None else self._heard | heard
        for described in late:
            self._describe(described)
        seen = [number for number, (_, one) in enumerate(window) if isinstance(one, HostEvent) and self._has_seen(one)]
        for received_ms, one in window[seen[-1] + 1 if seen else 0 :]:
            if isinstance(one, Described):
                self._hear_description(one)
            elif seen or received_ms > self.start.received_ms:
                self._feed(received_ms, one)

    def _described_at_the_snapshot(self, window: Sequence[tuple[int, HostEvent | Described]]) -> list[Described]:
        """Have the descriptions hold with which the states were folded; return those that were heard before the snapshot, and
        were to hold behind the next message."""
        heard = [*self._describes.values()]
        heard += [one for at_ms, one in window if isinstance(one, Described) and at_ms <= self.start.received_ms]
        held = {key for payload in (self.start.snapshots or {}).values() for key in versions_of(payload)}
        late: list[Described] = []
        for one in heard:
            if (one.machine, one.role, one.version) in held or not one.version:
                late = [later for later in late if (later.machine, later.role) != (one.machine, one.role)]
                self._describe(one)
            else:
                late.append(one)
        return late

    def _has_seen(self, event: HostEvent) -> bool:
        """Return True if a value that the restored state holds is of this message."""
        lane = None if event.device is None else self._engine.lane_of(event.device)
        if lane is None or event.kind is not EventKind.DATA:
            return False
        known = ((lane.row.get(reading.name), reading) for reading in event.readings)
        return any(row is not None and row[1:3] == reading[1:3] for row, reading in known)

    def _feed(self, received_ms: int, event: HostEvent) -> None:
        self._wall_s = max(self._wall_s, received_ms / 1000)
        self._silence()
        if not self._hears(event):
            return
        self._took(self._engine.feed(event, self._wall_s))

    def _silence(self) -> None:
        if self._beats:
            while self._beat_ms is not None and self._wall_s * 1000 > self._beat_ms + 2 * BEAT_MS:
                self._beat(self._beat_ms + BEAT_MS)
        self._took(self._engine.silence(self._wall_s - POLL_S))

    def _beat(self, at_ms: int) -> None:
        if self._beat_ms is None or at_ms > self._beat_ms:
            self._beat_ms = at_ms
            self._took(self._engine.beat(at_ms))

    def _hears(self, event: HostEvent) -> bool:
        """True if it had heard the birth. Where it was started from nothing in the middle, one is made up, without any value."""
        key = event.node, event.device
        if self._heard is not None:
            if event.kind is EventKind.BIRTH and key not in self._heard:
                began_ms = self._births.get((event.device or "", str(event.node)), 0)
                is_after = began_ms > 0 or self._wall_s * 1000 >= self._saved_ms - QUICKER_MS
                if event.timestamp_ms >= began_ms and is_after:  # who is not in a snapshot was not heard when it was saved
                    self._heard.add(key)
                if event.timestamp_ms > began_ms > 0:
                    self.notes.append(f"it heard {event.node} from {began_ms} on, the log only from {event.timestamp_ms}")
            return key in self._heard or (event.device is None and any(node == event.node for node, _ in self._heard))
        if self.start.snapshots is None and key not in self._known and event.device is not None:
            self._known.add(key)
            if event.kind is EventKind.DATA:
                at_ms = event.timestamp_ms
                names = self._names.get(event.device, {}).get(event.node, ())
                nulls = [Reading(name, None, at_ms, Quality.BAD, None, NOT_KNOWN, False) for name in names]
                self._took(self._engine.feed(event._replace(kind=EventKind.BIRTH, readings=tuple(nulls)), self._wall_s))
        return True

    # What came of it.

    def _took(self, actions: Sequence[Action]) -> None:
        for action in actions:
            if isinstance(action, Publish):
                if action.machine in self._declared:
                    self._published(action)
            elif isinstance(action, Declare):
                self._declared.add(action.machine)
                self._said(EventKind.BIRTH, action.machine, action.latest)
            elif isinstance(action, Remove):
                self._declared.discard(action.machine)
                self._said(EventKind.DEATH, action.machine, ())
            elif isinstance(action, DeadLetter):
                self.dead_letters += 1

    def _published(self, action: Publish) -> None:
        if action.machine == self._machine:
            self.comparison.recomputed(action.machine, action.changes, is_counted=self._is_counted)
        self._said(EventKind.DATA, action.machine, action.changes)

    def _said(self, kind: EventKind, machine: str, changes: Sequence[Change]) -> None:
        if not self._is_chained:
            return
        at_ms = round(self._wall_s * 1000)
        readings = tuple(
            Reading(one.name, as_sent(one.value, self._types[one.name][0]), *one[2:4], self._types[one.name][1], *one[4:6])
            for one in changes
        )
        node = NodeId("cnc", self.processor.node)
        self._produced.append(
            HostEvent(kind, node, machine, at_ms, readings, "device offline" if kind is EventKind.DEATH else "")
        )


def outputs_of(processor: AnyProcessor) -> tuple[OutputSpec, ...]:
    """Return all that a processor may publish, of a challenger too."""
    return processor.outputs + challenger_specs(processor.outputs)
