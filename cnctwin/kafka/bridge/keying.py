"""The topics on which an event goes out, with its key: the machine, and the cell of each processor that compares machines.

A processor that compares machines reads of a message what it asks for, so its topic holds no more. A message without any of that
only tells the time, and one a second of each machine is enough for that.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from cnctwin.kafka.topics import Topics
from processors.config import Configuration, ProcessorConfig
from processors.discovery import AnyProcessor
from processors.running.runtime import Configured
from sparkplug.host_event import EventKind, HostEvent

CLOCK_MS = 1000
MACHINES_MAX = 20_000
LAYOUTS_MAX = 4096
_DATA = EventKind.DATA


class Addressed(NamedTuple):
    """An event with the topic and key under which it goes out."""

    topic: str
    key: str
    event: HostEvent


_Cell = tuple[str, AnyProcessor, Configuration[ProcessorConfig], frozenset[str] | None]
"""The topic of a processor that compares machines, and the signals that it asks for; None stands for all."""
_Read = tuple[bool, list[_Cell]]


class Keying:
    """See the module. `pairs`: the processors that run on the log, with their configuration."""

    def __init__(self, topics: Topics, pairs: Sequence[Configured]) -> None:
        self._readings = topics.readings
        self._cells: list[_Cell] = [
            (topics.cells(one.name), one, configuration, one.signals) for one, configuration in pairs if one.is_of_cells
        ]
        self._folds = [one for one, _ in pairs if not one.is_of_cells]
        self._told_ms: dict[tuple[str, str], int] = {}
        self._picks: dict[str, dict[tuple[str, ...], tuple[int, ...]]] = {topic: {} for topic, *_ in self._cells}
        self._read: dict[str, _Read] = {}

    @property
    def topics(self) -> list[str]:
        """All topics that events go out on."""
        return [self._readings, *(topic for topic, *_ in self._cells)]

    def addressed(self, event: HostEvent) -> Iterator[Addressed]:
        """Yield the copies of an event of a device."""
        machine, node = event.device or "", event.node.node
        read = self._read.get(node)
        if read is None:
            read = self._read[node] = self._readers_of(node)
        is_read, cells = read
        if is_read:
            yield Addressed(self._readings, machine, event)
        for topic, processor, configuration, signals in cells:
            if (part := self._part(topic, event, signals)) is not None:
                yield Addressed(topic, processor.unit_of(configuration, machine), part)

    def _readers_of(self, node: str) -> _Read:
        """Return whether any processor of single machines reads a node, and the processors of cells that do."""
        return any(one.listens_to(node) for one in self._folds), [one for one in self._cells if one[1].listens_to(node)]

    def _part(self, topic: str, event: HostEvent, signals: frozenset[str] | None) -> HostEvent | None:
        """Return what a processor asks for of an event; None where it is nothing, and the time is known."""
        if event.kind is not _DATA or signals is None:
            return event
        places = self._places(topic, event, signals)
        place = topic, event.device or ""
        if not places and event.timestamp_ms - self._told_ms.get(place, 0) < CLOCK_MS:
            return None
        if len(self._told_ms) >= MACHINES_MAX:
            self._told_ms.clear()
        self._told_ms[place] = event.timestamp_ms
        if not places:
            return event
        all_readings = event.read()
        names = tuple([event.names[at] for at in places]) if event.names else ()
        return event._replace(readings=tuple([all_readings[at] for at in places]), names=names, packed=None)

    def _places(self, topic: str, event: HostEvent, signals: frozenset[str]) -> tuple[int, ...]:
        """Return where the readings stand that a processor asks for; messages of one layout share their names."""
        picks = self._picks[topic]
        places = picks.get(event.names) if event.names else None
        if places is None:
            names = event.names or [reading.name for reading in event.read()]
            places = tuple([at for at, name in enumerate(names) if name in signals])
            if event.names:
                if len(picks) >= LAYOUTS_MAX:
                    picks.clear()
                picks[event.names] = places
        return places
