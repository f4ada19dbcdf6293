"""A processor's engine, without I/O: events of a host session in, what is to be sent out. The clock is an argument.

It keeps a live lane and, once history comes, a history lane for each machine; decides which edge node a signal is taken from
where two offer it; and keeps the ledger. What has a state, and is saved as one, is a unit: a machine, or a cell of them.
"""

import itertools
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from operator import itemgetter

from processors.config import ALL, CellConfig, Configuration, ProcessorConfig
from processors.contract import CellProcessor
from processors.discovery import AnyProcessor
from processors.effects import Declare, Effect, PublishPlain, Remove
from processors.errors import SnapshotError
from processors.running.counts import Counts
from processors.running.fold import Fold
from processors.running.lane import Lane
from processors.running.ledger import DropReason, Ledger
from processors.running.snapshot import SnapshotCodec
from processors.sample import Sample, SampleKind
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from twin.vocabulary.nodes import is_twin_node

MACHINES_MAX = 1000
SIGNALS_MAX = 5000
_IS_HISTORICAL: Callable[[Reading], bool] = itemgetter(Reading._fields.index("is_historical"))


@dataclass(slots=True)
class _Unit:
    """What has a state: a machine, or a cell with all its machines."""

    name: str
    live: Fold
    machines: dict[str, "_Machine"] = field(default_factory=dict)
    history: Fold | None = None


@dataclass(slots=True)
class _Machine:
    """A machine, the sources that are online, and which source each signal is taken from.

    It is online while an edge of it is: what other processors say of it, they would go on saying of a machine that is off.
    """

    name: str
    unit: _Unit
    live: Lane
    history: Lane | None = None
    online: set[NodeId] = field(default_factory=set)
    owner: dict[str, NodeId] = field(default_factory=dict)
    excluded: dict[NodeId, frozenset[str]] = field(default_factory=dict)

    @property
    def is_online(self) -> bool:
        """Whether an edge of it is."""
        return any(not is_twin_node(node.node) for node in self.online)


class Engine:
    """See the module. Every method that returns effects has already counted what it did."""

    def __init__(
        self,
        processor: AnyProcessor,
        configuration: Configuration[ProcessorConfig],
        *,
        lateness_margin_s: float = 2.0,
        machines_max: int = MACHINES_MAX,
    ) -> None:
        self.ledger = Ledger()
        self.counts = Counts()
        self._processor, self._configuration = processor, configuration
        self._margin_s, self._machines_max = lateness_margin_s, machines_max
        self._cell_config: CellConfig | None = configuration.default if isinstance(configuration.default, CellConfig) else None
        self._machines: dict[str, _Machine] = {}
        self._units: dict[str, _Unit] = {}
        self._changed: dict[str, None] = {}
        self._codec = SnapshotCodec(processor)
        if self._cell_config is not None and isinstance(processor, CellProcessor) and (processor.beats or processor.listens):
            for cell in [*self._cell_config.cells, ALL]:  # they work without any machine
                self._unit(cell)

    @property
    def machines(self) -> tuple[str, ...]:
        """The machines that are online."""
        return tuple(name for name, machine in self._machines.items() if machine.is_online)

    @property
    def units(self) -> tuple[str, ...]:
        """The machines, or the cells, that have a state to be kept."""
        return tuple(dict.fromkeys(machine.unit.name for machine in self._machines.values() if machine.is_online))

    # Events.

    def feed(self, event: HostEvent, wall_s: float) -> list[Effect]:
        """Take one event; `wall_s` is any clock that only goes forward."""
        kind, node, device = event.kind, event.node, event.device
        if not self._processor.listens_to(node.node):
            self.counts.ignored += 1
            return []
        effects: list[Effect] = []
        if device is None:
            self._node_event(event, effects)
            return effects
        self.ledger.received += 1
        machine = self._machines.get(device)
        if kind is EventKind.DATA:
            if machine is None or node not in machine.online:
                self.ledger.drop(DropReason.BEFORE_BIRTH)
            else:
                self._data(machine, event, wall_s, effects)
        elif kind is EventKind.BIRTH:
            self._birth(machine, event, wall_s, effects)
        elif kind is EventKind.DEATH:
            self._death(machine, event, effects)
        else:
            self.ledger.received -= 1  # a hole is no message
            if machine is not None:
                machine.live.lost(event.detail, effects)
        if machine is None:
            machine = self._machines.get(device)
        if machine is not None:
            self._changed[machine.unit.name] = None
        return effects

    def plain(self, topic: str, payload: bytes, at_ms: int) -> list[Effect]:
        """A plain message that the processor listens to; every cell is given it."""
        detail = payload.decode("utf-8", "replace")
        return self._of_no_machine(Sample("", SampleKind.PLAIN, at_ms / 1000, {}, detail=detail, topic=topic), at_ms)

    def beat(self, at_ms: int) -> list[Effect]:
        """A second has passed on the wall, where the processor wants to know."""
        if not isinstance(self._processor, CellProcessor) or not self._processor.beats:
            return []
        return self._of_no_machine(Sample("", SampleKind.BEAT, at_ms / 1000, {}), at_ms)

    def _of_no_machine(self, sample: Sample, at_ms: int) -> list[Effect]:
        effects: list[Effect] = []
        for unit in self._units.values():
            before = unit.live.state
            unit.live.take(sample._replace(cell=unit.live.cell), at_ms, effects)
            if unit.live.state is not before:
                self._changed[unit.name] = None
        return effects

    def silence(self, wall_s: float) -> list[Effect]:
        """No event waits: give ticks up to the present, less the margin. Call it only when the queue is empty."""
        effects: list[Effect] = []
        for machine in self._machines.values():
            clock_ms = machine.live.clock_ms
            machine.live.silence(wall_s, self._margin_s, effects)
            if machine.live.clock_ms != clock_ms:
                self._changed[machine.unit.name] = None
        return effects

    # Snapshots.

    def restore(self, payload: bytes) -> str:
        """Take the snapshot of a unit, before any event of it; its name. Raises SnapshotError, and counts it."""
        try:
            name, document = self._codec.unit(payload)
            unit = self._fresh_unit(name)
            self._codec.restore(document.get("live"), unit.live, lambda machine: self._restored(unit, machine).live)
            if document.get("history") is not None:
                unit.history = self._fold(name, is_history=True)
                self._codec.restore(document["history"], unit.history, lambda machine: self._history_of(unit, machine))
            if len(self._machines) + len(unit.machines) > self._machines_max:
                raise SnapshotError(f"{name}: more than {self._machines_max} machines")
        except SnapshotError:
            self.counts.snapshots_rejected += 1
            raise
        self._units[name] = unit
        self._machines.update(unit.machines)
        for machine in [one for one in unit.machines if self._unit_name(one) != name]:
            self._forget(machine)  # it has been given to another cell since
        return name

    def resume(self, payload: bytes, offers: Mapping[str, Mapping[NodeId, Collection[str]]]) -> str:
        """As `restore`, to go on at the very message at which the snapshot was taken: a replay's start. A machine that was online
        still is, by the nodes whose births were heard: `offers` has their signals by machine and node; the first owns."""
        name = self.restore(payload)
        for machine in self._units[name].machines.values():
            machine.live.go_on()
            if machine.live.ticking:
                for node, names in offers.get(machine.name, {}).items():
                    if self._processor.listens_to(node.node) and (not machine.live.births or str(node) in machine.live.births):
                        machine.online.add(node)
                        clashing = frozenset(one for one in names if one in machine.owner)
                        machine.excluded[node] = clashing
                        machine.owner.update((one, node) for one in names if one in machine.live.row and one not in clashing)
        return name

    def lane_of(self, machine: str) -> Lane | None:
        """The live lane of a machine, to look at; None where it is not known."""
        known = self._machines.get(machine)
        return None if known is None else known.live

    def snapshot(self, name: str) -> bytes:
        """The snapshot of a unit. Raises KeyError where there is none of that name."""
        unit = self._units[name]
        lanes = {machine.name: machine.live for machine in unit.machines.values()}
        late = {machine.name: machine.history for machine in unit.machines.values() if machine.history is not None}
        return self._codec.encode(name, unit.live, lanes, unit.history, late)

    def take_changed(self) -> list[str]:
        """The units that have moved since this was last called."""
        changed = [name for name in self._changed if name in self._units]
        self._changed.clear()
        return changed

    def mark_all_changed(self) -> None:
        """The broker may have forgotten what it retained."""
        self._changed.update(dict.fromkeys(self._units))

    def bury_unborn(self, at_ms: int) -> list[Effect]:
        """Machines that were restored and have not been born since are offline: say so."""
        effects: list[Effect] = []
        for machine in self._machines.values():
            if machine.live.is_restored and not machine.is_online:
                machine.live.is_restored = False
                reason = "not seen since the processor was started"
                self._die(machine, list(machine.live.row), at_ms, reason, effects, is_last=True)
        return effects

    def farewell(self, at_ms: int) -> list[PublishPlain]:
        """The processor stops: what its plain messages say of online machines is no longer kept up. (Its twin devices die with
        its edge node.) The state is not to be saved after this."""
        effects: list[Effect] = []
        if not self._processor.plain:
            return []
        for machine in self._machines.values():
            if machine.is_online:
                machine.live.death(list(machine.live.row), at_ms, "the processor was stopped", effects, is_last=True)
        return [effect for effect in effects if isinstance(effect, PublishPlain)]

    # How it is done.

    def _fold(self, name: str, *, is_history: bool) -> Fold:
        return Fold(self._processor, self._configuration, name, self.counts, is_history=is_history)

    def _fresh_unit(self, name: str) -> _Unit:
        return _Unit(name, self._fold(name, is_history=False))

    def _unit(self, name: str) -> _Unit:
        """The unit of that name, made where there is none."""
        if name not in self._units:
            self._units[name] = self._fresh_unit(name)
        return self._units[name]

    def _lane(self, fold: Fold, machine: str) -> Lane:
        config = self._configuration.of(machine) if self._cell_config is None else self._cell_config
        return Lane(fold, self._processor.inputs, config, machine, self.ledger, self.counts)

    def _unit_name(self, machine: str) -> str:
        return machine if self._cell_config is None else self._cell_config.cell_of(machine)

    def _joined(self, name: str) -> _Machine:
        """A machine that is new here, in the unit that it belongs to."""
        machine = self._machines[name] = self._restored(self._unit(self._unit_name(name)), name)
        return machine

    def _restored(self, unit: _Unit, name: str) -> _Machine:
        """The machine of a unit, made where there is none; only the unit knows of it."""
        if name not in unit.machines:
            unit.machines[name] = _Machine(name, unit, self._lane(unit.live, name))
        return unit.machines[name]

    def _history_of(self, unit: _Unit, name: str) -> Lane:
        machine = self._restored(unit, name)
        if unit.history is None:
            unit.history = self._fold(unit.name, is_history=True)
        if machine.history is None:
            machine.history = self._lane(unit.history, name)
        return machine.history

    def _is_of_twin(self, node: NodeId) -> bool:
        """Whether only what is an input tells this processor the time: another processor may stamp by the wall's clock."""
        return self._processor.inputs is not None and is_twin_node(node.node)

    def _data(self, machine: _Machine, event: HostEvent, wall_s: float, effects: list[Effect]) -> None:
        readings: tuple[Reading, ...] | list[Reading] = event.readings
        is_of_twin = self._is_of_twin(event.node)
        excluded = machine.excluded.get(event.node)
        if excluded:
            readings = [reading for reading in readings if reading.name not in excluded]
            if not readings and event.readings:
                self.ledger.drop(DropReason.NAME_CLASH)
                return
        if is_of_twin:
            readings = [reading for reading in readings if reading.name in (self._processor.inputs or ())]
            if not readings:
                self.ledger.emitted += 1  # nothing of it is for this processor
                return
            if not machine.is_online:
                machine.live.note(readings)
                return
        if True not in map(_IS_HISTORICAL, readings):
            machine.live.data(readings, wall_s, effects, is_of_twin=is_of_twin)
            return
        live = [reading for reading in readings if not reading.is_historical]
        if live:  # a message with both goes through both lanes, and counts as two
            machine.live.data(live, wall_s, effects, is_of_twin=is_of_twin)
            self.ledger.received += 1
        history = self._history_of(machine.unit, machine.name)
        history.data([reading for reading in readings if reading.is_historical], wall_s, effects)

    def _birth(self, machine: _Machine | None, event: HostEvent, wall_s: float, effects: list[Effect]) -> None:
        if len(event.readings) > SIGNALS_MAX:
            self.ledger.drop(DropReason.SIGNALS_MAX)
            return
        if machine is None:
            if len(self._machines) >= self._machines_max and not self._forget_one():
                self.ledger.drop(DropReason.MACHINES_MAX)
                return
            machine = self._joined(event.device or "")
        is_of_twin = self._is_of_twin(event.node)
        was_online = machine.is_online
        machine.online.add(event.node)
        machine.live.born(str(event.node), event.timestamp_ms)
        taken = self._taken(machine, event)
        if not machine.is_online and self._processor.inputs is not None:  # another processor is quicker than the edge
            machine.live.note(taken)
            return
        if not was_online and self._processor.outputs:
            effects.append(Declare(machine.name, machine.live.emission.known(event.timestamp_ms)))
        machine.live.birth(taken if is_of_twin else event.readings, taken, wall_s, effects, is_of_twin=is_of_twin)

    def _taken(self, machine: _Machine, event: HostEvent) -> list[Reading]:
        """The readings of a birth that this processor takes from this source. A signal belongs to the first source that is
        online with it; what a source offered before and does not offer any more is withdrawn."""
        inputs, node, owner = self._processor.inputs, event.node, machine.owner
        offered = [reading for reading in event.readings if inputs is None or reading.name in inputs]
        clashing = {r.name for r in offered if owner.get(r.name, node) != node and owner[r.name] in machine.online}
        machine.excluded[node] = frozenset(clashing)
        taken = [reading for reading in offered if reading.name not in clashing]
        names = {reading.name for reading in taken}
        gone = [name for name, source in owner.items() if source == node and name not in names]
        machine.live.withdraw([name for name in gone if name in machine.live.row])
        for name in gone:
            del owner[name]
        owner.update(dict.fromkeys(names, node))
        if len(machine.live.row) > SIGNALS_MAX:
            for name in [name for name in machine.live.row if name not in owner]:
                del machine.live.row[name]
        return taken

    def _death(self, machine: _Machine | None, event: HostEvent, effects: list[Effect]) -> None:
        if machine is None or event.node not in machine.online:
            self.ledger.drop(DropReason.ALREADY_DEAD)
        elif self._source_dies(machine, event, effects):
            self.ledger.emitted += 1
        else:
            self.ledger.drop(DropReason.DEAD_LETTER)

    def _node_event(self, event: HostEvent, effects: list[Effect]) -> None:
        """A hole of an edge node concerns each machine that it stands for. Its death comes as one death for each device."""
        if event.kind is not EventKind.HOLE:
            return
        for machine in self._machines.values():
            if event.node in machine.online:
                machine.live.lost(event.detail, effects)
                self._changed[machine.unit.name] = None

    def _source_dies(self, machine: _Machine, event: HostEvent, effects: list[Effect]) -> bool:
        was_online = machine.is_online
        machine.online.discard(event.node)
        names = [name for name, source in machine.owner.items() if source == event.node and name in machine.live.row]
        is_last = was_online and not machine.is_online
        return self._die(machine, names, event.timestamp_ms, event.detail or "offline", effects, is_last=is_last)

    def _die(self, machine: _Machine, names: list[str], at_ms: int, reason: str, effects: list[Effect], *, is_last: bool) -> bool:
        folded = machine.live.death(names, at_ms, reason, effects, is_last=is_last)
        if is_last and self._processor.outputs:
            effects.append(Remove(machine.name))
        return folded

    def _forget_one(self) -> bool:
        """Make room: the machine that has been offline longest by order of arrival goes."""
        offline = itertools.islice((name for name, machine in self._machines.items() if not machine.online), 1)
        for name in list(offline):
            self._forget(name)
            return True
        return False

    def _forget(self, name: str) -> None:
        lost = self._machines.pop(name)
        for lane in (lost.live, lost.history):
            if lane is not None:
                lane.drop_held()
                lane.fold.leave(name)
        del lost.unit.machines[name]
        if self._cell_config is None:
            del self._units[name]
