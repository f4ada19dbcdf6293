"""Units, each with a state that is saved as one: a machine or a cell of them; and the machines that the engine knows."""

from collections.abc import Callable
from dataclasses import dataclass, field

from processors.running.fold import Fold, Folded
from processors.running.lane import Lane
from sparkplug.host_session import HostEvent
from sparkplug.metric import NodeId
from twin.vocabulary.nodes import is_twin_node


@dataclass(slots=True)
class Unit:
    """The holder of a state: a machine, or a cell with all its machines."""

    name: str
    live: Fold
    machines: dict[str, "Machine"] = field(default_factory=dict)
    history: Fold | None = None


@dataclass(slots=True)
class Machine:
    """A machine, the sources that are online, and which source each signal is taken from.

    number: in the order in which the machines became known
    ways: how the data of a node are taken, found at its first message after a birth or a death

    It is online while an edge of it is: what other processors say of it, they would go on saying of a machine that is off.
    """

    name: str
    number: int
    unit: Unit
    live: Lane
    history: Lane | None = None
    online: set[NodeId] = field(default_factory=set)
    owner: dict[str, NodeId] = field(default_factory=dict)
    excluded: dict[NodeId, frozenset[str]] = field(default_factory=dict)
    ways: dict[NodeId, Callable[[HostEvent, float], Folded]] = field(default_factory=dict)

    @property
    def is_online(self) -> bool:
        """True while an edge of it is online."""
        return any(not is_twin_node(node.node) for node in self.online)
