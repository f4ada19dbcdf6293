"""A processor's engine, without I/O: events of a host session in, what is to be sent out. The clock is an argument.

It keeps a live lane and, once history comes, a history lane for each machine; decides which edge node a signal is taken from
where two offer it; and keeps the ledger.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from operator import itemgetter
from typing import Any

from processors.config import Configuration, ProcessorConfig
from processors.contract import Processor
from processors.effects import Declare, Effect, PublishPlain, Remove
from processors.errors import SnapshotError
from processors.lane import Counts, Lane
from processors.ledger import DropReason, Ledger
from processors.snapshot import SnapshotCodec
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading

MACHINES_MAX = 1000
SIGNALS_MAX = 5000
_IS_HISTORICAL: Callable[[Reading], bool] = itemgetter(Reading._fields.index("is_historical"))


@dataclass(slots=True)
class _Machine:
    """A machine, the sources that are online, and which source each signal is taken from."""

    name: str
    live: Lane
    history: Lane | None = None
    online: set[NodeId] = field(default_factory=set)
    owner: dict[str, NodeId] = field(default_factory=dict)
    excluded: dict[NodeId, frozenset[str]] = field(default_factory=dict)


class Engine:
    """See the module. Every method that returns effects has already counted what it did."""

    def __init__(
        self,
        processor: Processor[Any, Any],
        configuration: Configuration[ProcessorConfig],
        *,
        lateness_margin_s: float = 2.0,
        machines_max: int = MACHINES_MAX,
    ) -> None:
        self.ledger = Ledger()
        self.counts = Counts()
        self._processor, self._configuration = processor, configuration
        self._margin_s, self._machines_max = lateness_margin_s, machines_max
        self._machines: dict[str, _Machine] = {}
        self._changed: dict[str, None] = {}
        self._codec = SnapshotCodec(processor)

    @property
    def machines(self) -> tuple[str, ...]:
        """The machines that are online."""
        return tuple(name for name, machine in self._machines.items() if machine.online)

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
        self._changed[device] = None
        return effects

    def silence(self, wall_s: float) -> list[Effect]:
        """No event waits: give ticks up to the present, less the margin. Call it only when the queue is empty."""
        effects: list[Effect] = []
        for machine in self._machines.values():
            clock_ms = machine.live.clock_ms
            machine.live.silence(wall_s, self._margin_s, effects)
            if machine.live.clock_ms != clock_ms:
                self._changed[machine.name] = None
        return effects

    # Snapshots.

    def restore(self, payload: bytes) -> str:
        """Take a machine's snapshot, before any event of it; its name. Raises SnapshotError, and counts it."""
        try:
            name, document = self._codec.machine(payload)
            if len(self._machines) >= self._machines_max:
                raise SnapshotError(f"{name}: more than {self._machines_max} machines")
            machine = _Machine(name, self._lane(name))
            self._codec.restore(document.get("live"), machine.live)
            if document.get("history") is not None:
                machine.history = self._lane(name, is_history=True)
                self._codec.restore(document["history"], machine.history)
        except SnapshotError:
            self.counts.snapshots_rejected += 1
            raise
        self._machines[name] = machine
        return name

    def snapshot(self, name: str) -> bytes:
        """The snapshot of a machine."""
        machine = self._machines[name]
        return self._codec.encode(name, machine.live, machine.history)

    def take_changed(self) -> list[str]:
        """The machines that have moved since this was last called."""
        changed = [name for name in self._changed if name in self._machines]
        self._changed.clear()
        return changed

    def mark_all_changed(self) -> None:
        """The broker may have forgotten what it retained."""
        self._changed.update(dict.fromkeys(self._machines))

    def bury_unborn(self, at_ms: int) -> list[Effect]:
        """Machines that were restored and have not been born since are offline: say so."""
        effects: list[Effect] = []
        for machine in self._machines.values():
            if machine.live.is_restored and not machine.online:
                machine.live.is_restored = False
                self._die(machine, list(machine.live.row), at_ms, "not seen since the processor was started", effects)
        return effects

    def farewell(self, at_ms: int) -> list[PublishPlain]:
        """The processor stops: what its plain messages say of online machines is no longer kept up. (Its twin devices die with
        its edge node.) The state is not to be saved after this."""
        effects: list[Effect] = []
        if not self._processor.plain:
            return []
        for machine in self._machines.values():
            if machine.online:
                machine.live.death(list(machine.live.row), at_ms, "the processor was stopped", effects, is_last=True)
        return [effect for effect in effects if isinstance(effect, PublishPlain)]

    # How it is done.

    def _lane(self, name: str, *, is_history: bool = False) -> Lane:
        config = self._configuration.of(name)
        return Lane(self._processor, config, name, self.ledger, self.counts, is_history=is_history)

    def _data(self, machine: _Machine, event: HostEvent, wall_s: float, effects: list[Effect]) -> None:
        readings: tuple[Reading, ...] | list[Reading] = event.readings
        excluded = machine.excluded.get(event.node)
        if excluded:
            readings = [reading for reading in readings if reading.name not in excluded]
            if not readings and event.readings:
                self.ledger.drop(DropReason.NAME_CLASH)
                return
        if True not in map(_IS_HISTORICAL, readings):
            machine.live.data(readings, wall_s, effects)
            return
        live = [reading for reading in readings if not reading.is_historical]
        if live:  # a message with both goes through both lanes, and counts as two
            machine.live.data(live, wall_s, effects)
            self.ledger.received += 1
        if machine.history is None:
            machine.history = self._lane(machine.name, is_history=True)
        machine.history.data([reading for reading in readings if reading.is_historical], wall_s, effects)

    def _birth(self, machine: _Machine | None, event: HostEvent, wall_s: float, effects: list[Effect]) -> None:
        if len(event.readings) > SIGNALS_MAX:
            self.ledger.drop(DropReason.SIGNALS_MAX)
            return
        if machine is None:
            if len(self._machines) >= self._machines_max and not self._forget_one():
                self.ledger.drop(DropReason.MACHINES_MAX)
                return
            name = event.device or ""
            machine = self._machines[name] = _Machine(name, self._lane(name))
        if not machine.online and self._processor.outputs:
            effects.append(Declare(machine.name, machine.live.emission.known(event.timestamp_ms)))
        machine.online.add(event.node)
        machine.live.birth(event.readings, self._taken(machine, event), wall_s, effects)

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
                self._changed[machine.name] = None

    def _source_dies(self, machine: _Machine, event: HostEvent, effects: list[Effect]) -> bool:
        machine.online.discard(event.node)
        names = [name for name, source in machine.owner.items() if source == event.node and name in machine.live.row]
        return self._die(machine, names, event.timestamp_ms, event.detail or "offline", effects)

    def _die(self, machine: _Machine, names: list[str], at_ms: int, reason: str, effects: list[Effect]) -> bool:
        folded = machine.live.death(names, at_ms, reason, effects, is_last=not machine.online)
        if not machine.online and self._processor.outputs:
            effects.append(Remove(machine.name))
        return folded

    def _forget_one(self) -> bool:
        """Make room: the machine that has been offline longest by order of arrival goes."""
        offline = itertools.islice((name for name, machine in self._machines.items() if not machine.online), 1)
        for name in list(offline):
            lost = self._machines.pop(name)
            for lane in (lost.live, lost.history):
                if lane is not None:
                    lane.drop_held()
            return True
        return False
