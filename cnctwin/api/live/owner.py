"""A device or a node as one node tells of it: its metrics, each with its last reading and its trace."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from cnctwin.api.fleet import is_key_signal
from cnctwin.api.live.trace import Trace
from sparkplug.host_event import NODE_OFFLINE
from sparkplug.metric import Reading
from twin.vocabulary.nodes import TWIN_NODE_PREFIX, is_twin_node


class Signal:
    """One metric of one owner: its last reading, its trace, and what the birth says of it."""

    __slots__ = ("is_key", "live_ms", "meaning", "provenance", "reading", "trace", "whole_ms")

    def __init__(self, reading: Reading, provenance: str, meaning: str | None) -> None:
        self.reading = reading
        self.provenance = provenance
        self.meaning = meaning
        self.trace = Trace()
        self.is_key = is_key_signal(reading.name)
        self.live_ms = reading.timestamp_ms  # of the last value that was told, and not only marked stale
        self.whole_ms = reading.timestamp_ms  # nothing is missing in the trace since then


@dataclass(slots=True)
class Owner:
    """The metrics of a device, or of a node itself, as one node tells them."""

    online: bool = False
    is_control: bool = False  # it tells measured values, not only the twin's
    signals: dict[str, Signal] = field(default_factory=dict)
    clashing: dict[str, Signal] = field(default_factory=dict)  # that another node of the machine tells already


def offline_reason(node: str, reason: str | None) -> str | None:
    """Return why values of a node are stale: that of a processor names the processor, so that nobody looks at the edge.

    >>> offline_reason("twin-cutting_force", "edge node offline"), offline_reason("edge-vmc", "edge node offline")
    ('the processor cutting_force is offline', 'edge node offline')
    """
    if reason == NODE_OFFLINE and is_twin_node(node):
        return f"the processor {node.removeprefix(TWIN_NODE_PREFIX)} is offline"
    return reason


def share(owners: Iterable[Owner]) -> None:
    """Give each signal of a machine to one node: the first that is online, as the processors do, else the first that told it.

    No node changes what another one says, by taking the name of its machine.
    """
    told: set[str] = set()
    for owner in sorted(owners, key=lambda owner: not owner.online):
        every = owner.clashing | owner.signals
        owner.signals = {name: signal for name, signal in every.items() if name not in told}
        owner.clashing = {name: signal for name, signal in every.items() if name in told}
        told.update(owner.signals)
