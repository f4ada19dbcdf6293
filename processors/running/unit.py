"""Units, each with a state that is saved as one: a machine or a cell of them; and the machines that the engine knows."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field

from processors.actions import Declare
from processors.running.fold import Fold, Folded
from processors.running.lane import Lane
from processors.running.picks import Stream
from sparkplug.host_session import HostEvent
from sparkplug.metric import NodeId, Reading
from twin.vocabulary.nodes import is_twin_node

SIGNALS_MAX = 5000  # of a machine


@dataclass(slots=True)
class Unit:
    """The holder of a state: a machine, or a cell with all its machines."""

    name: str
    live: Fold
    machines: dict[str, "Machine"] = field(default_factory=dict)
    history: Fold | None = None


@dataclass(slots=True)
class Machine:
    """A machine, and the sources that are online.

    ways: how the data of a node are taken, found at its first message after a birth or a death

    It is online while an edge of it is: what other processors say of it, they would go on saying of a machine that is off.
    """

    name: str
    unit: Unit
    live: Lane
    history: Lane | None = None
    online: set[NodeId] = field(default_factory=set)
    excluded: dict[NodeId, frozenset[str]] = field(default_factory=dict)
    ways: dict[NodeId, Callable[[Stream, float], Folded]] = field(default_factory=dict)

    @property
    def owner(self) -> dict[str, NodeId]:
        """Return the source that each signal is taken from."""
        return self.live.owner

    @property
    def is_online(self) -> bool:
        """True while an edge of it is online."""
        return any(not is_twin_node(node.node) for node in self.online)

    def declared(self, at_ms: int) -> Declare:
        """Return the birth of its twin device, with the challenger's metrics while it has one."""
        known, challenger = self.live.emission.known(at_ms), self.unit.live.challenger
        if challenger is None:
            return Declare(self.name, known)
        return Declare(self.name, known + challenger.emission.known(at_ms), is_challenged=True)

    def go_on(self, offers: Mapping[NodeId, Collection[str]]) -> None:
        """Go on with a restored lane at the message at which it was saved: who was online, by the births that were heard, still
        is. `offers`: the signals of each node that is read; where an old snapshot does not say who owns one, the first does."""
        self.live.go_on()
        is_told = bool(self.owner)
        for node, names in offers.items() if self.live.ticking else ():
            if not self.live.births or str(node) in self.live.births:
                self.online.add(node)
                clashing = frozenset(one for one in names if self.owner.get(one, node) != node)
                self.excluded[node] = clashing
                if not is_told:
                    self.owner.update((one, node) for one in names if one in self.live.row and one not in clashing)

    def taken(self, birth: HostEvent, inputs: frozenset[str] | None) -> list[Reading]:
        """The readings of a birth that are taken from its source. A signal belongs to the first source that is online with it;
        what a source offered before and does not offer any more is withdrawn."""
        node, owner, row = birth.node, self.owner, self.live.row
        offered = [reading for reading in birth.readings if inputs is None or reading.name in inputs]
        clashing = {r.name for r in offered if owner.get(r.name, node) != node and owner[r.name] in self.online}
        self.excluded[node] = frozenset(clashing)
        taken = [reading for reading in offered if reading.name not in clashing]
        names = {reading.name: node for reading in taken}  # in the birth's order, in which a death names them too
        gone = [name for name, source in owner.items() if source == node and name not in names]
        self.live.withdraw([name for name in gone if name in row])
        for name in gone:
            del owner[name]
        owner.update(names)
        if len(row) > SIGNALS_MAX:
            for name in [name for name in row if name not in owner]:
                del row[name]
        return taken
