"""The topics on which an event goes out, with its key: the machine, and the cell of each processor that compares machines.

A processor that compares machines reads of a message what it asks for, so its topic holds no more. A message without any of that
only tells the time, and one a second of each machine is enough for that.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from cnctwin.kafka.topics import Topics
from processors.running.runtime import Configured
from sparkplug.host_event import EventKind, HostEvent

CLOCK_MS = 1000
MACHINES_MAX = 20_000
_DATA = EventKind.DATA


class Addressed(NamedTuple):
    """An event with the topic and key under which it goes out."""

    topic: str
    key: str
    event: HostEvent


class Keying:
    """See the module. `pairs`: the processors that run on the log, with their configuration."""

    def __init__(self, topics: Topics, pairs: Sequence[Configured]) -> None:
        self._readings = topics.readings
        self._cells = [
            (topics.cells(one.name), one, configuration, one.signals) for one, configuration in pairs if one.is_of_cells
        ]
        self._folds = [one for one, _ in pairs if not one.is_of_cells]
        self._told_ms: dict[tuple[str, str], int] = {}
        self._readers: dict[str, bool] = {}

    @property
    def topics(self) -> list[str]:
        """All topics that events go out on."""
        return [self._readings, *(topic for topic, *_ in self._cells)]

    def addressed(self, event: HostEvent) -> Iterator[Addressed]:
        """Yield the copies of an event of a device."""
        machine, node = event.device or "", event.node.node
        is_read = self._readers.get(node)
        if is_read is None:
            is_read = self._readers[node] = any(one.listens_to(node) for one in self._folds)
        if is_read:
            yield Addressed(self._readings, machine, event)
        for topic, processor, configuration, signals in self._cells:
            if processor.listens_to(node) and (part := self._part(topic, event, signals)) is not None:
                yield Addressed(topic, processor.unit_of(configuration, machine), part)

    def _part(self, topic: str, event: HostEvent, signals: frozenset[str] | None) -> HostEvent | None:
        """Return what a processor asks for of an event; None where it is nothing, and the time is known."""
        if event.kind is not _DATA or signals is None:
            return event
        readings = tuple(one for one in event.readings if one.name in signals)
        place = topic, event.device or ""
        if not readings and event.timestamp_ms - self._told_ms.get(place, 0) < CLOCK_MS:
            return None
        if len(self._told_ms) >= MACHINES_MAX:
            self._told_ms.clear()
        self._told_ms[place] = event.timestamp_ms
        return event if not readings or len(readings) == len(event.readings) else event._replace(readings=readings)
