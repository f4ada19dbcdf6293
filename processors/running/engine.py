"""A processor's engine, without I/O: events of a host session in, what is to be sent out. The clock is an argument.

It keeps a live lane and, once history comes, a history lane for each machine; decides which edge node a signal is taken from
where two offer it; and keeps the ledger. What has a state, and is saved as one, is a unit: a machine, or a cell of them.
"""

from collections.abc import Callable, Collection, Mapping
from operator import itemgetter

from processors.actions import Action, PlainOutput, Remove
from processors.config import Configuration, ProcessorConfig
from processors.description import Description, Role
from processors.discovery import AnyProcessor
from processors.errors import SnapshotError
from processors.running.counts import Counts
from processors.running.fold import Folded
from processors.running.lane import Lane
from processors.running.ledger import FOLDED, DropReason, Ledger
from processors.running.picks import Picks, Stream, stream_of
from processors.running.roster import Roster
from processors.running.silences import Silences
from processors.running.snapshot import SnapshotCodec
from processors.running.unit import SIGNALS_MAX, Machine
from processors.sample import Sample, SampleKind
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from twin.vocabulary.nodes import is_twin_node

MACHINES_MAX = 1000
Way = Callable[[Stream, float], list[Action]]
"""Takes a message at a time on the wall; what comes of it."""
_NO_MESSAGES = (EventKind.HOLE, EventKind.REFUSED)  # of a device, as they come; REFUSED says itself how many it stands for
_IS_HISTORICAL: Callable[[Reading], bool] = itemgetter(Reading._fields.index("is_historical"))


class Engine:
    """See the module. Every method that returns actions has already counted what it did; nobody else counts.

    Only what is an input of another processor tells this one the time (`is_of_twin`): it may stamp by the wall's clock.
    """

    def __init__(
        self,
        processor: AnyProcessor,
        configuration: Configuration[ProcessorConfig],
        *,
        lateness_margin_s: float = 2.0,
        machines_max: int = MACHINES_MAX,
        before: "Engine | None" = None,
    ) -> None:
        """`before`: the engine that this one replaces, whose ledger and counts it goes on with."""
        self.ledger: Ledger = Ledger() if before is None else before.ledger
        self.counts: Counts = Counts() if before is None else before.counts
        self._processor, self._configuration = processor, configuration
        self._picks = Picks(processor.signals, processor.wakes)
        self._inputs = self._picks.inputs
        self._roster = Roster(processor, configuration, self._picks, self.counts, self.ledger, machines_max=machines_max)
        self._machines, self.known_units = self._roster.machines, self._roster.units
        self.silences = Silences(lateness_margin_s)
        self._changed: dict[str, None] = {}
        self._codec = SnapshotCodec(processor)
        self._emitted_before = 0
        self.undescribed: set[str] = set()  # machines whose new description waits for their next message
        if before is not None:
            self._roster.described_as(before._roster)
        for unit in processor.units_at_start(configuration):
            self._roster.unit(unit)

    @property
    def machines(self) -> tuple[str, ...]:
        """The machines that are online."""
        return tuple(name for name, machine in self._machines.items() if machine.is_online)

    @property
    def awaited(self) -> tuple[NodeId, ...]:
        """The nodes whose births restored machines wait for."""
        return self._roster.awaited

    @property
    def units(self) -> tuple[str, ...]:
        """The machines, or the cells, that have a state to be kept."""
        return tuple(dict.fromkeys(machine.unit.name for machine in self._machines.values() if machine.is_online))

    def unit_of(self, machine: str) -> str | None:
        """The unit of a machine that is online; None of another."""
        known = self._machines.get(machine)
        return known.unit.name if known is not None and known.is_online else None

    # Events.

    def _is_message(self, event: HostEvent) -> bool:
        """Return True if the ledger counts it: it is of a device, from a node that this processor reads."""
        return event.device is not None and event.kind not in _NO_MESSAGES and self._processor.listens_to(event.node.node)

    def feed(self, event: HostEvent, wall_s: float) -> list[Action]:
        """Take one event; `wall_s` is any clock that only goes forward."""
        kind, node, device = event.kind, event.node, event.device
        self._emitted_before = self.ledger.emitted
        if not self._processor.listens_to(node.node):
            self.counts.ignored += 1
            return []
        if device is None or kind is EventKind.REFUSED:
            return self._node_event(event)
        machine = self._machines.get(device)
        if kind is EventKind.HOLE:  # no message
            actions = [] if machine is None else machine.live.lost(event.detail)
        else:
            if kind is EventKind.DATA:
                actions, fates = self._data(machine, event, wall_s)
            elif kind is EventKind.BIRTH:
                actions, fates = self._birth(machine, event, wall_s)
            else:
                actions, fates = self._death(machine, event)
            self.ledger.count(fates)
        machine = machine or self._machines.get(device)
        if machine is not None:
            self._changed[machine.unit.name] = None
            self.silences.watch(machine)
            if is_twin_node(node.node):
                actions = actions + machine.live.hear_challengers(event.readings)
            elif device in self.undescribed:
                actions = actions + self._take_up(machine)
        return actions

    def way_of(self, node: NodeId, device: str) -> Way | None:
        """Return the shortest way for data of a device whose names are given: it does what `feed` does.

        There is one once a message of the node was fed; it holds until the machine is born again or dies.
        """
        machine = self._machines.get(device)
        if machine is None or (take := machine.ways.get(node)) is None:
            return None
        ledger, changed, unit, lane, silences = self.ledger, self._changed, machine.unit.name, machine.live, self.silences

        def way(message: Stream, wall_s: float) -> list[Action]:
            actions, fates = take(message, wall_s)
            if actions:
                self._emitted_before = ledger.emitted
            if fates is FOLDED:  # what nearly every message is
                ledger.received += 1
                ledger.emitted += 1
            else:
                ledger.count(fates)
            changed[unit] = None
            if not lane.is_awaited:
                silences.watch(machine)
            return actions

        return way

    def overflowed(self, count: int, reason: DropReason = DropReason.QUEUE_FULL) -> None:
        """A queue in front of us has lost so many messages."""
        self.ledger.overflowed(count, reason)

    def lost(self, event: HostEvent, reason: DropReason) -> None:
        """An event is lost before it is fed, or feeding it has failed before it was counted."""
        if event.kind is EventKind.REFUSED:
            self.feed(event, 0.0)  # it is nothing but a count
        elif self._is_message(event):
            self.ledger.count((reason,))

    def unsent(self, reason: DropReason = DropReason.BROKER_OFFLINE) -> None:
        """Note that the outcome of the last event could not be sent."""
        if self.ledger.emitted > self._emitted_before:
            self.ledger.unsent(reason)

    def abandon(self, name: str, at_ms: int) -> list[Action]:
        """Forget a machine that a fault has set aside, state and all; what is to be said of it."""
        machine = self._machines.get(name)
        if machine is None:
            return []
        removed: list[Action] = [Remove(name)] if self._processor.outputs else []
        try:
            return self._die(machine, list(machine.live.row), at_ms, "set aside after faults", is_last=True)[0]
        except Exception:  # what made it fail may make this fail too
            return removed
        finally:
            self._roster.forget(name)

    def close(self) -> None:
        """Another engine takes over: what is held back is dropped."""
        self._roster.drop_held()

    def plain(self, topic: str, payload: bytes, at_ms: int) -> list[Action]:
        """A plain message that the processor listens to; every cell is given it."""
        detail = payload.decode("utf-8", "replace")
        return self._of_no_machine(Sample("", SampleKind.PLAIN, at_ms / 1000, {}, detail=detail, topic=topic), at_ms)

    def beat(self, at_ms: int) -> list[Action]:
        """A second has passed on the wall, where the processor wants to know."""
        return self._of_no_machine(Sample("", SampleKind.BEAT, at_ms / 1000, {}), at_ms) if self._processor.beats else []

    def _of_no_machine(self, sample: Sample, at_ms: int) -> list[Action]:
        actions: list[Action] = []
        for unit in [self.known_units[name] for name in sorted(self.known_units)]:  # so that a restart changes no order
            before = unit.live.state
            actions += unit.live.take(sample._replace(cell=unit.live.cell), at_ms)[0]
            if unit.live.state is not before:
                self._changed[unit.name] = None
        return actions

    def silence(self, wall_s: float, is_meant: Callable[[str], bool] = lambda _: True) -> list[Action]:
        """Give the machines that are meant, of which no event waits, their ticks up to the present, less the margin."""
        actions: list[Action] = []
        for machine in self.silences.due(wall_s):
            clock_ms = machine.live.clock_ms
            actions += machine.live.silence(wall_s, self.silences.margin_s) if is_meant(machine.name) else []
            if machine.live.clock_ms != clock_ms:
                self._changed[machine.unit.name] = None
            self.silences.watch(machine)
        return actions

    # Descriptions.

    @property
    def is_described(self) -> bool:
        """Return True if the descriptions of machines make a difference to the processor."""
        return self._roster.is_described

    def describe(self, machine: str, role: Role, description: Description | None) -> list[Action]:
        """Take up the description of a machine, None where there is none any more. Do not use its ways after this.

        While it is online that is behind the next message of its edge, so that the ticks of a silence, which may have been given
        early, are of the description before. Raises what the processor raises at it; then the one before holds.
        """
        known = self._machines.get(machine)
        try:
            self._roster.describe(machine, role, description)
        finally:
            if known is not None:
                known.ways.clear()
                known.live.is_challenged |= self._roster.challenger(machine) is not None
                self.undescribed.add(machine)
        return [] if known is None or known.is_online else self._take_up(known)

    def _take_up(self, machine: Machine) -> list[Action]:
        """Fold with the descriptions that hold now."""
        self.undescribed.discard(machine.name)
        return self._roster.take_up(machine)

    # Snapshots.

    def restore(self, payload: bytes) -> str:
        """Take the snapshot of a unit, before any event of it; its name. Raises SnapshotError, and counts it."""
        try:
            name, document = self._codec.unit(payload)
            unit = self._roster.fresh_unit(name)
            self._codec.restore(document.get("live"), unit.live, lambda machine: self._roster.member(unit, machine).live)
            if document.get("history") is not None:
                unit.history = self._roster.fold(name, is_history=True)
                self._codec.restore(document["history"], unit.history, lambda machine: self._roster.history_of(unit, machine))
            if len(self._machines) + len(unit.machines) > self._roster.machines_max:
                raise SnapshotError(f"{name}: more than {self._roster.machines_max} machines")
        except SnapshotError:
            self.counts.snapshots_rejected += 1
            raise
        self.known_units[name] = unit
        self._machines.update(unit.machines)
        for machine in [one for one in unit.machines if self._roster.unit_name(one) != name]:
            self._roster.forget(machine)  # it has been given to another cell since
        return name

    def resume(self, payload: bytes, offers: Mapping[str, Mapping[NodeId, Collection[str]]]) -> str:
        """Restore, to go on at the very message at which the snapshot was taken: a replay's start. A machine that was online
        still is, by the nodes whose births were heard: `offers` has their signals by machine and node; the first owns."""
        name = self.restore(payload)
        for machine in self.known_units[name].machines.values():
            own = offers.get(machine.name, {})
            machine.go_on({node: names for node, names in own.items() if self._processor.listens_to(node.node)})
        return name

    def lane_of(self, machine: str) -> Lane | None:
        """The live lane of a machine, to look at; None where it is not known."""
        known = self._machines.get(machine)
        return None if known is None else known.live

    def snapshot(self, name: str) -> bytes:
        """The snapshot of a unit. Raises KeyError where there is none of that name."""
        unit = self.known_units[name]
        lanes = {machine.name: machine.live for machine in unit.machines.values()}
        late = {machine.name: machine.history for machine in unit.machines.values() if machine.history is not None}
        return self._codec.encode(name, unit.live, lanes, unit.history, late)

    def take_changed(self) -> list[str]:
        """The units that have moved since this was last called."""
        changed = [name for name in self._changed if name in self.known_units]
        self._changed.clear()
        return changed

    def mark_all_changed(self) -> None:
        """The broker may have forgotten what it retained."""
        self._changed.update(dict.fromkeys(self.known_units))

    def bury_unborn(self, at_ms: int) -> list[Action]:
        """Machines that were restored and have not been born since are offline: say so."""
        actions: list[Action] = []
        for machine in self._machines.values():
            if machine.live.is_restored and not machine.is_online:
                machine.live.is_restored = False
                reason = "not seen since the processor was started"
                self.ledger.count(machine.live.drop_held(), 0)
                actions += self._die(machine, list(machine.live.row), at_ms, reason, is_last=True)[0]
        return actions

    def farewell(self, at_ms: int) -> list[PlainOutput]:
        """The processor stops: what its plain messages say of online machines is no longer kept up. (Its twin devices die with
        its edge node.) The state is not to be saved after this."""
        actions: list[Action] = []
        for machine in self._machines.values() if self._processor.plain else ():
            if machine.is_online:
                self.ledger.count(machine.live.drop_held(), 0)
                actions += machine.live.death(list(machine.live.row), at_ms, "the processor was stopped", is_last=True)[0]
        return [action for action in actions if isinstance(action, PlainOutput)]

    # How it is done.

    def _is_of_twin(self, node: NodeId) -> bool:
        """Return True if the node is another processor's, whose word a reader of signals of its choice takes for no clock."""
        return self._inputs is not None and is_twin_node(node.node)

    def _data(self, machine: Machine | None, event: HostEvent, wall_s: float) -> Folded:
        if machine is None or event.node not in machine.online:
            return [], (DropReason.BEFORE_BIRTH,)
        if event.names and machine.is_online and not machine.excluded.get(event.node):
            way = machine.live.twin if self._is_of_twin(event.node) else machine.live.stream
            is_heard = machine.live.is_challenged and self._is_of_twin(event.node)
            machine.ways[event.node] = machine.live.twin_and_challengers if is_heard else way
            return way(stream_of(event), wall_s)
        readings: tuple[Reading, ...] | list[Reading] = event.readings
        inputs = self._inputs
        is_of_twin = self._is_of_twin(event.node)
        excluded = machine.excluded.get(event.node)
        if excluded:
            readings = [reading for reading in readings if reading.name not in excluded]
            if not readings and event.readings:
                return [], (DropReason.NAME_CLASH,)
        if is_of_twin:
            readings = [reading for reading in readings if reading.name in (inputs or ())]
            if not readings:
                return [], FOLDED  # nothing of it is for this processor
            if not machine.is_online:
                machine.live.note(readings)
                return [], FOLDED
        if True not in map(_IS_HISTORICAL, readings):
            return machine.live.data(readings, wall_s, is_of_twin=is_of_twin)
        actions: list[Action] = []
        live = [reading for reading in readings if not reading.is_historical]
        if live:  # a message with both goes through both lanes, and counts as two
            actions, fates = machine.live.data(live, wall_s, is_of_twin=is_of_twin)
            self.ledger.count(fates)
        history = self._roster.history_of(machine.unit, machine.name)
        late, fates = history.data([reading for reading in readings if reading.is_historical], wall_s)
        return actions + late, fates

    def _birth(self, machine: Machine | None, event: HostEvent, wall_s: float) -> Folded:
        if len(event.readings) > SIGNALS_MAX:
            return [], (DropReason.SIGNALS_MAX,)
        if machine is None:
            if not self._roster.has_room():
                return [], (DropReason.MACHINES_MAX,)
            machine = self._roster.joined(event.device or "")
        is_of_twin = self._is_of_twin(event.node)
        was_online = machine.is_online
        machine.ways.clear()
        machine.online.add(event.node)
        machine.live.born(str(event.node), event.timestamp_ms)
        taken = machine.taken(event, self._inputs)
        if not machine.is_online and self._inputs is not None:  # another processor is quicker than the edge
            machine.live.note(taken)
            return [], FOLDED
        declared = [machine.declared(event.timestamp_ms)] if not was_online and self._processor.outputs else []
        offered = taken if is_of_twin else event.readings
        actions, fates = machine.live.birth(offered, taken, wall_s, is_of_twin=is_of_twin)
        return [*declared, *actions], fates

    def _death(self, machine: Machine | None, event: HostEvent) -> Folded:
        if machine is None or event.node not in machine.online:
            return [], (DropReason.ALREADY_DEAD,)
        was_online = machine.is_online
        machine.ways.clear()
        machine.online.discard(event.node)
        names = [name for name, source in machine.owner.items() if source == event.node and name in machine.live.row]
        is_last = was_online and not machine.is_online
        late = machine.live.drop_held()
        actions, fates = self._die(machine, names, event.timestamp_ms, event.detail or "offline", is_last=is_last)
        return actions, late + fates

    def _node_event(self, event: HostEvent) -> list[Action]:
        """A hole of an edge node concerns each machine that it stands for. Its death comes as one death for each device."""
        actions: list[Action] = []
        self.ledger.refused(event.refusal, event.refused)
        for machine in self._machines.values() if event.kind is EventKind.HOLE else ():
            if event.node in machine.online:
                actions += machine.live.lost(event.detail)
                self._changed[machine.unit.name] = None
        return actions

    def _die(self, machine: Machine, names: list[str], at_ms: int, reason: str, *, is_last: bool) -> Folded:
        actions, fates = machine.live.death(names, at_ms, reason, is_last=is_last)
        return ([*actions, Remove(machine.name)] if is_last and self._processor.outputs else actions), fates
