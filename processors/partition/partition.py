"""One partition of a log, folded by the processors of a process: records in, results out, and what is to be saved.

    restore(kept) ──► the offset to read from        take(offset, record) ──► results        cut(), mark() ──► what to save

Everything that a state depends on is in the records and their order: time on the wall is the writer's, silence is a watermark.
That of one writer says nothing of the machines that another one hears: a bridge that is gone leaves its machines as they are.
So a partition that was restored anywhere and folds the rest comes to the same state, bit for bit, as one that has folded all of
it.

Saved are, by key: `<processor>/<unit>`, a unit's state; `~description/<reader>|<topic>`, a description that holds;
`~lives/<topic>/<reader>`, which messages were there already; and `~marker/<topic>/<reader>`, how far this reader has come with
each processor: the offset at which its states were cut, and that up to which its results went out. What lies between the two is
folded again in silence.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from processors.actions import Action
from processors.config import Configuration, ProcessorConfig
from processors.discovery import AnyProcessor
from processors.errors import SnapshotError
from processors.partition.places import KeptLives, KeptMarker, read
from processors.partition.seat import FORMAT, Seat
from processors.running.engine import Way
from processors.running.picks import stream_of
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import NodeId
from sparkplug.records.lives import Lives
from sparkplug.records.record import Record
from twin.vocabulary import topics
from twin.vocabulary.nodes import is_twin_node

MARKER, LIVES, DESCRIPTION = "~marker/", "~lives/", "~description/"
AS_OF = "|"  # between a reader and the topic of a description: each reader has come to another place
LIVES_MAX = 5000  # devices whose messages are told apart
_DATA, _PLAIN, _HOLE = EventKind.DATA, EventKind.PLAIN, EventKind.HOLE
_to_json = json.JSONEncoder(separators=(",", ":"), ensure_ascii=False).encode


class Result(NamedTuple):
    """The actions that came of one record by one processor."""

    seat: Seat
    actions: list[Action]
    at_ms: int


class Partition:
    """See the module. `reader` names who folds it: the consumer group. `topic`: what is folded; each topic of a reader
    has places of its own among what is saved. `is_home`: whether a cell has its messages in this partition. Plain messages and
    silence come to all partitions, and a cell that was in several of them would answer once from each."""

    def __init__(
        self,
        reader: str,
        pairs: Sequence[tuple[AnyProcessor, Configuration[ProcessorConfig]]],
        topic: str = "",
        is_home: Callable[[str], bool] = lambda _: True,
    ) -> None:
        self.seats = tuple(
            Seat(processor, configuration, is_home) for processor, configuration in sorted(pairs, key=lambda one: one[0].name)
        )
        self.next = 0  # the offset behind the newest record that was taken
        self.repeated = 0  # records that were there before
        self.refused: list[str] = []  # snapshots that were not restored, and why
        self._topic = f"{topic}/" if topic else ""
        self._reader = f"{self._topic}{reader}"
        self._begin = 0  # records before it are in all states
        self._lives: dict[str, Lives] = {}
        self._writers: dict[str, str] = {}  # who hears a machine
        self._descriptions: dict[str, bytes] = {}
        self._new_descriptions: dict[str, bytes | None] = {}
        self._readers: dict[str, tuple[Seat, ...]] = {}
        self._ways: dict[str, dict[NodeId, list[tuple[Seat, Way | None]]]] = {}  # by device and node

    # Start.

    def restore(self, kept: Mapping[str, bytes]) -> int:
        """Take what was saved, newest value by key; return the offset to read from. A processor whose states are of another
        version begins with what the log still holds, and says nothing of what it said before. A key that no runner writes is
        nobody's. Raises SnapshotError, which names the key, where it is not known how far anybody had come."""
        markers = [read(KeptMarker, key, value).processors for key, value in kept.items() if key.startswith(MARKER)]
        own = DESCRIPTION + self._reader + AS_OF
        held = own if MARKER + self._reader in kept else DESCRIPTION  # a new reader takes those of the readers before it
        self._descriptions = {key.partition(AS_OF)[2]: value for key, value in kept.items() if key.startswith(held)}
        for seat in self.seats:
            self._describe_all(seat)
            self._restore(seat, kept, markers)
        self.next = self._begin = min(seat.from_offset for seat in self.seats)
        lives = [read(KeptLives, key, value) for key, value in kept.items() if key.startswith(LIVES + self._topic)]
        known = next((one for one in lives if one.folded == self.next), KeptLives(folded=0, devices={}))
        self._lives = {device: Lives(of_device) for device, of_device in known.devices.items()}
        self._writers = dict(known.writers)
        return self.next

    def _restore(self, seat: Seat, kept: Mapping[str, bytes], markers: Sequence[Mapping[str, Sequence[int]]]) -> None:
        """Restore one processor from the marker that has come furthest with it."""
        own = max((one[seat.name] for one in markers if seat.name in one), key=lambda one: one[1], default=None)
        if own is None:
            return
        folded, seat.published = own
        prefix = f"{seat.name}/"
        units = {key.removeprefix(prefix): payload for key, payload in kept.items() if key.startswith(prefix)}
        restored = 0
        try:
            for unit, payload in units.items():
                seat.restore(unit, payload)
                restored += 1
        except SnapshotError as error:
            refused = f"{prefix}{list(units)[restored]}"
            self.refused.append(f"{refused}: {error}; {seat.name} is rebuilt from what the log still holds")
            seat.begin_again(units)
            self._describe_all(seat)
        else:
            seat.from_offset = folded

    def _describe_all(self, seat: Seat) -> None:
        for topic, payload in self._descriptions.items():
            seat.describe(topic, payload)

    # Records.

    def take(self, offset: int, record: Record) -> Sequence[Result]:
        """Fold a record; return what came of it that did not go out before."""
        self.next = offset + 1
        if offset < self._begin:
            return ()
        event = record.event
        if event is None:
            return self._watermark(offset, record)
        if event.kind is _PLAIN:
            return list(self._plain(event, offset, record))
        if not self._is_new(event, record):
            self.repeated += 1
            return ()
        if event.names:
            return self._stream(event, offset, record)
        if event.kind is not _DATA:
            self._ways.pop(event.device or "", None)
        told: list[Result] = []
        for seat in self._readers_of(event.node.node):
            if offset >= seat.from_offset:
                told += self._told(seat, seat.event(event, record.received_ms / 1000), offset, record)
        return told

    def _stream(self, event: HostEvent, offset: int, record: Record) -> Sequence[Result]:
        """Data whose names are given take the engines' shortest ways, from one birth or death of the machine to the next."""
        source, device = event.node, event.device or ""
        of_device = self._ways.get(device)
        if of_device is None:
            if len(self._ways) >= LIVES_MAX:
                self._ways.clear()
            of_device = self._ways[device] = {}
        ways = of_device.get(source)
        if ways is None:
            ways = of_device[source] = [(seat, None) for seat in self._readers_of(source.node)]
        received_ms = record.received_ms
        message, wall_s = stream_of(event), received_ms / 1000
        told: list[Result] = []
        for place, (seat, way) in enumerate(ways):
            if offset < seat.from_offset:
                continue
            if way is None:  # the first message shows the way
                actions = seat.event(event, wall_s)
                ways[place] = seat, seat.engine.way_of(source, device)
            else:
                try:
                    actions = way(message, wall_s)
                except Exception as error:
                    actions = seat.failed(event, error)
            if actions and offset >= seat.published:
                told.append(Result(seat, actions, received_ms))
        return told

    def _watermark(self, offset: int, record: Record) -> Sequence[Result]:
        writer = record.writer

        def is_meant(machine: str) -> bool:
            return self._writers.get(machine, writer) == writer

        told: list[Result] = []
        for seat in self.seats:
            if offset >= seat.from_offset:
                told += self._told(seat, seat.watermark(record.received_ms / 1000, is_meant), offset, record)
        return told

    @staticmethod
    def _told(seat: Seat, actions: list[Action], offset: int, record: Record) -> Sequence[Result]:
        return (Result(seat, actions, record.received_ms),) if actions and offset >= seat.published else ()

    def _is_new(self, event: HostEvent, record: Record) -> bool:
        lives = self._lives.get(device := event.device or "")
        if lives is None:
            if len(self._lives) >= LIVES_MAX:
                self._lives.pop(next(iter(self._lives)))
            lives = self._lives[device] = Lives()
        is_new = lives.is_new(str(event.node), record.origin, event.timestamp_ms, is_hole=event.kind is _HOLE)
        if is_new and not is_twin_node(event.node.node):
            if len(self._writers) >= LIVES_MAX and device not in self._writers:
                del self._writers[next(iter(self._writers))]
            self._writers[device] = record.writer
        return is_new

    def _readers_of(self, node: str) -> tuple[Seat, ...]:
        readers = self._readers.get(node)
        if readers is None:
            readers = self._readers[node] = tuple(seat for seat in self.seats if seat.processor.listens_to(node))
        return readers

    def _plain(self, event: HostEvent, offset: int, record: Record) -> Iterator[Result]:
        if event.topic.startswith(topics.DESCRIPTION):
            if self._descriptions.get(event.topic) == event.payload:
                return  # retained, and told again
            self._described(event.topic, event.payload)
            self._ways.clear()
            for seat in self.seats:
                yield from self._told(seat, seat.describe(event.topic, event.payload), offset, record)
            return
        for seat in self.seats:
            if offset >= seat.from_offset and event.payload and seat.listens(event.topic):
                yield from self._told(seat, seat.plain(event.topic, event.payload, event.timestamp_ms), offset, record)

    def _described(self, topic: str, payload: bytes) -> None:
        self._new_descriptions[topic] = payload or None
        if payload:
            self._descriptions[topic] = payload
        else:
            self._descriptions.pop(topic, None)

    # What is to be saved.

    def cut(self) -> Iterator[tuple[str, bytes | None]]:
        """Yield what has changed since the last cut, by key; a value of None takes back what was saved. `mark` comes after it."""
        for topic, payload in self._new_descriptions.items():
            yield DESCRIPTION + self._reader + AS_OF + topic, payload
        self._new_descriptions.clear()
        for seat in self.seats:
            seat.from_offset = max(seat.from_offset, self.next)
            for unit, payload in seat.cut():
                yield f"{seat.name}/{unit}", payload
        devices = {device: known.kept for device, known in self._lives.items()}
        lives = {"folded": self.next, "devices": devices, "writers": self._writers}
        yield LIVES + self._reader, _to_json(lives).encode()

    @property
    def marker(self) -> str:
        """The key of the marker of this reader."""
        return MARKER + self._reader

    def mark(self) -> tuple[str, bytes]:
        """Return the marker, by key: what came of all records before `next` goes out with it."""
        for seat in self.seats:
            seat.published = max(seat.published, self.next)
        told = {"format": FORMAT, "processors": {seat.name: [seat.from_offset, seat.published] for seat in self.seats}}
        return self.marker, _to_json(told).encode()

    def faults(self) -> list[str]:
        """Return what failed since this was last called, in a line each."""
        faults = [*self.refused, *(fault for seat in self.seats for fault in seat.faults)]
        self.refused.clear()
        for seat in self.seats:
            seat.faults.clear()
        return faults
