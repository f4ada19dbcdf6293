"""The machines that an engine knows, and the units that hold their states: who joins, and who is forgotten."""

from processors.actions import Action
from processors.config import Configuration, ProcessorConfig
from processors.description import Description, Given, Role
from processors.discovery import AnyProcessor
from processors.running.counts import Counts
from processors.running.fold import Fold
from processors.running.lane import Lane
from processors.running.ledger import DropReason, Ledger
from processors.running.picks import Picks
from processors.running.unit import Machine, Unit
from sparkplug.metric import NodeId


class Roster:
    """Machines and units by name. A machine that is forgotten takes what was held back of it along: `ledger` counts that."""

    def __init__(
        self,
        processor: AnyProcessor,
        configuration: Configuration[ProcessorConfig],
        picks: Picks,
        counts: Counts,
        ledger: Ledger,
        *,
        machines_max: int,
    ) -> None:
        self.machines: dict[str, Machine] = {}
        self.units: dict[str, Unit] = {}
        self.machines_max = machines_max
        self._processor, self._configuration, self._picks = processor, configuration, picks
        self._counts, self._ledger = counts, ledger
        self._given: dict[tuple[str, Role], Given] = {}  # by the descriptions of machines
        self._has_challengers = self.is_described and any(spec.of_challenger for spec in processor.outputs)

    @property
    def is_described(self) -> bool:
        """Return True if the descriptions of machines make a difference."""
        return self._processor.described is not None and not self._processor.is_of_cells

    def describe(self, machine: str, role: Role, description: Description | None) -> None:
        """Have a description hold for what is made of the machine from now on. Raises what the processor raises at it: then the
        live one before holds, and there is no challenger."""
        if description is None or role is Role.CHALLENGER:
            self._given.pop((machine, role), None)
        if description is not None and (role is Role.LIVE or self._has_challengers):
            made = self._processor.given(self._configuration, machine, description)
            self._given[machine, role] = Given(description.version, made)

    def described_as(self, before: "Roster") -> None:
        """Take over the descriptions of the roster that this one replaces."""
        self._given = dict(before._given)

    def challenger(self, machine: str) -> Given | None:
        """Return what the challenger of a machine makes of the configuration; None where there is none."""
        return self._given.get((machine, Role.CHALLENGER))

    def given(self, machine: str) -> Given:
        """Return what the live description of a machine makes of the configuration."""
        known = self._given.get((machine, Role.LIVE))
        return Given("", self._processor.given(self._configuration, machine)) if known is None else known

    def unit(self, name: str) -> Unit:
        """Return the unit of that name, made where there is none."""
        return self.units.get(name) or self.units.setdefault(name, self.fresh_unit(name))

    def fresh_unit(self, name: str) -> Unit:
        """Return a new unit; nobody knows of it yet."""
        return Unit(name, self.fold(name, is_history=False))

    def take_up(self, machine: Machine) -> list[Action]:
        """Have a machine folded with the descriptions that hold now; what is to be sent where a challenger comes or goes."""
        unit, given = machine.unit, self.given(machine.name)
        for fold in (unit.live, unit.history):
            if fold is not None:
                fold.describe(given)
        if not machine.live.challenge(self.challenger(machine.name)) or not machine.is_online:
            return []
        at_ms, challenger = machine.live.clock_ms or 0, unit.live.challenger
        return [machine.declared(at_ms), *(() if challenger is None else challenger.begin(machine.name, at_ms))]

    @property
    def awaited(self) -> tuple[NodeId, ...]:
        """The nodes whose signals restored machines have, of machines that were not born again yet."""
        restored = (machine for machine in self.machines.values() if machine.live.is_restored)
        return tuple(dict.fromkeys(node for machine in restored for node in machine.owner.values()))

    def fold(self, name: str, *, is_history: bool) -> Fold:
        """Return a fold with the state from which it starts."""
        given = self.given(name) if self.is_described else None
        return Fold(self._processor, self._configuration, name, self._counts, is_history=is_history, given=given)

    def unit_name(self, machine: str) -> str:
        """Return the name of the unit that a machine belongs to by the configuration."""
        return self._processor.unit_of(self._configuration, machine)

    def joined(self, name: str) -> Machine:
        """Return a machine that is new here, in the unit that it belongs to."""
        machine = self.machines[name] = self.member(self.unit(self.unit_name(name)), name)
        return machine

    def member(self, unit: Unit, name: str) -> Machine:
        """Return the machine of a unit, made where there is none; only the unit knows of it."""
        if name not in unit.machines:
            unit.machines[name] = Machine(name, unit, self._lane(unit.live, name))
            unit.machines[name].live.challenge(self.challenger(name))
        return unit.machines[name]

    def history_of(self, unit: Unit, name: str) -> Lane:
        """Return the lane of a machine's history, made where there is none."""
        machine = self.member(unit, name)
        if unit.history is None:
            unit.history = self.fold(unit.name, is_history=True)
        if machine.history is None:
            machine.history = self._lane(unit.history, name)
        return machine.history

    def has_room(self) -> bool:
        """Make room for one more machine: the one that has been offline longest by order of arrival goes. False if none is."""
        if len(self.machines) < self.machines_max:
            return True
        name = next((name for name, machine in self.machines.items() if not machine.online), None)
        if name is not None:
            self.forget(name)
        return name is not None

    def forget(self, name: str) -> None:
        """Forget a machine; its state too, where it has one of its own."""
        lost = self.machines.pop(name)
        lost.live.ticking = False  # its silence may still be watched
        for lane in (lost.live, lost.history):
            if lane is not None:
                self._ledger.count(lane.drop_held(), 0)
                lane.fold.leave(name)
        del lost.unit.machines[name]
        if not self._processor.is_of_cells:
            del self.units[name]

    def drop_held(self) -> None:
        """Drop what is held back of all machines: nobody will come back to it."""
        for machine in self.machines.values():
            for lane in (machine.live, machine.history):
                if lane is not None:
                    self._ledger.count((DropReason.FAULT,) * len(lane.drop_held()), 0)

    def _lane(self, fold: Fold, machine: str) -> Lane:
        config = self._processor.config_of(self._configuration, machine)
        return Lane(fold, self._picks, config, machine, self._counts)
