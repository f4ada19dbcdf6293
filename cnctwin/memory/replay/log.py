"""The log of the machines of a cell as one stream, and what it says of the lives of the processors."""

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from cnctwin.memory.store.contract import Message, Store
from sparkplug.host_session import EventKind, HostEvent
from twin.vocabulary.nodes import is_twin_node

NOTHING_YET = (
    "nothing computed yet"  # of processors/running/emission.py: such a value is stamped by the birth that began the twin device
)
SAME_MS_MAX = 64


@dataclass(frozen=True, slots=True)
class Stretch:
    """A stretch of the log of several machines; reading it twice gives the same."""

    store: Store
    machines: tuple[str, ...]
    from_ms: int
    to_ms: int

    def messages(self) -> Iterator[Message]:
        """All messages in order of arrival; a hole of a node, which the log of each of its machines has, once."""
        logs = [self.store.messages(machine, self.from_ms, self.to_ms) for machine in self.machines]
        merged = logs[0] if len(logs) == 1 else heapq.merge(*logs, key=lambda message: message.received_ms)
        holes: list[Message] = []
        for message in merged:
            if message.event.kind is EventKind.HOLE and message.event.device is None:
                if message in holes:
                    continue
                holes = [*holes[-SAME_MS_MAX:], message]
            yield message


class Mark(NamedTuple):
    """A birth or a death in the log, or the first data of a processor; `stamps`: of values that nothing was computed for yet."""

    place: int
    received_ms: int
    event: HostEvent
    stamps: frozenset[int] = frozenset()


def marks(stretch: Stretch) -> tuple[list[Mark], int, int]:
    """Births, deaths, holes of the memory and the first data of each node; how many messages and samples there are."""
    found: list[Mark] = []
    heard: set[tuple[str, str | None]] = set()
    samples = place = 0
    for place, (received_ms, event) in enumerate(stretch.messages(), start=1):
        samples += len(event.readings)
        key = event.node.node, event.device
        if event.kind is EventKind.DATA and key in heard:
            continue
        heard.add(key)
        stamps = frozenset(reading.timestamp_ms for reading in event.readings if reading.reason == NOTHING_YET)
        found.append(Mark(place, received_ms, event._replace(readings=()), stamps))
    return found, place, samples


def is_twin(event: HostEvent) -> bool:
    """Return True if a processor says it."""
    return is_twin_node(event.node.node)


def birth_behind(found: Sequence[Mark], of_twin: Mark) -> Mark | None:
    """The birth of a machine's edge by which its twin device was born."""
    births = [
        mark
        for mark in found
        if mark.place < of_twin.place
        and mark.event.kind is EventKind.BIRTH
        and not is_twin(mark.event)
        and mark.event.device == of_twin.event.device
    ]
    stamped = [mark for mark in births if mark.event.timestamp_ms in of_twin.stamps]
    behind = stamped or births
    return behind[-1] if behind else None
