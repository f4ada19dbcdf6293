"""The replay: all records of the log folded once, by one process that nobody kills, and compared with what the run has left.

States are compared as bytes, results as their sequence in each partition by processor: kind, machine, topic, time, payload.
"""

import time
from array import array
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import blake2b
from typing import Any

from benchmarks.kafka.inputs import Inputs
from benchmarks.kafka.whole_log import headers_of, messages
from cnctwin.kafka.assigned import by_topic
from cnctwin.kafka.homes import home_in
from cnctwin.kafka.kept import read_kept
from cnctwin.kafka.topics import Topics
from processors.actions import DeadLetter
from processors.alerts.notification import Notification
from processors.alerts.statement import Statement
from processors.partition.partition import Partition
from processors.partition.results import Results
from processors.running.runtime import Configured
from sparkplug.records.record import Origin, RecordError, RecordReader, RecordWriter
from twin.vocabulary.topics import ALERT_OUTBOX

Place = tuple[int, str]
"""Number of a partition, name of a processor."""
_OUTBOX = ALERT_OUTBOX.encode()


@dataclass(slots=True)
class Difference:
    """The differences of two sequences or sets. `first` describes the first one."""

    expected: int = 0
    lost: int = 0
    extra: int = 0
    different: int = 0
    first: str = ""

    def add(self, other: "Difference") -> None:
        """Take up another's figures."""
        self.expected, self.lost = self.expected + other.expected, self.lost + other.lost
        self.extra, self.different = self.extra + other.extra, self.different + other.different
        self.first = self.first or other.first

    @property
    def total(self) -> int:
        """All that is not as it should be."""
        return self.lost + self.extra + self.different


@dataclass(slots=True)
class Found:
    """The outcome of a replay."""

    states: Difference = field(default_factory=Difference)
    results: Difference = field(default_factory=Difference)
    dead_letters: Difference = field(default_factory=Difference)
    records: int = 0
    repeated: int = 0
    unreadable: int = 0
    took_s: float = 0.0
    by_processor: Counter[str] = field(default_factory=Counter)


class Stood:
    """The results that stand in the log: a digest of each, in order, by partition and processor."""

    def __init__(self, bootstrap: str, topics: Topics, partitions: int) -> None:
        self.digests: dict[Place, array[int]] = {}
        self.emitted: dict[str, tuple[Statement, ...]] = {}
        """The notifications that were handed to the courier, by id."""
        for number in range(partitions):
            for message in messages(bootstrap, topics.results, number):
                headers = headers_of(message)
                told: dict[str, Any] = dict(headers)
                value = message.value() or b""
                self.digests.setdefault((number, told["processor"].decode()), array("Q")).append(
                    digest(message.key() or b"", headers, value)
                )
                if value and told.get("topic", b"").startswith(_OUTBOX):
                    self.emitted[told["topic"].removeprefix(_OUTBOX).decode()] = Notification.of(value).statements
        self.dead_letters = sum(1 for number in range(partitions) for _ in messages(bootstrap, topics.deadletters, number))


def digest(key: bytes | str, headers: Sequence[tuple[str, Any]], value: bytes) -> int:
    """Return a number for all of a result but who wrote it."""
    told = blake2b(key if isinstance(key, bytes) else key.encode(), digest_size=8)
    for name, content in headers:
        if name != "writer":
            told.update(name.encode() + b"\0" + (content if isinstance(content, bytes) else str(content).encode()) + b"\0")
    told.update(value)
    return int.from_bytes(told.digest(), "big")


class Replay:
    """See the module."""

    def __init__(self, bootstrap: str, topics: Topics, pairs: Sequence[Configured], partitions: int) -> None:
        self._bootstrap, self._topics, self._partitions = bootstrap, topics, partitions
        self._by_topic = by_topic(topics, pairs)
        self._results = {processor.name: Results(topics.group, processor) for processor, _ in pairs}
        self._writer, self._reader = RecordWriter("replay"), RecordReader()
        self._dead_letters = 0

    def compared(self, stood: Stood, inputs: Inputs) -> Found:
        """Fold all records and compare; `inputs` is told of each record of the readings."""
        began_s, found = time.monotonic(), Found()
        kept = read_kept({"bootstrap.servers": self._bootstrap}, self._topics.snapshots, range(self._partitions), timeout_s=120.0)
        for number in range(self._partitions):
            states: dict[str, bytes] = {}
            for topic in self._by_topic:
                partition = self._folded(topic, number, stood, found, inputs)
                states |= {
                    f"{seat.name}/{unit}": seat.state_of(unit) for seat in partition.seats for unit in seat.engine.known_units
                }
                found.repeated += partition.repeated
            left = {key: value for key, value in kept[number].items() if not key.startswith("~")}
            found.states.add(states_compared(states, left, number))
        found.dead_letters = Difference(
            self._dead_letters,
            max(self._dead_letters - stood.dead_letters, 0),
            max(stood.dead_letters - self._dead_letters - found.unreadable, 0),
        )
        found.took_s = time.monotonic() - began_s
        return found

    def _folded(self, topic: str, number: int, stood: Stood, found: Found, inputs: Inputs) -> Partition:
        """Return the partition after all of its records."""
        partition = Partition("replay", self._by_topic[topic], topic, home_in(number, self._partitions))
        told = {seat.name: array("Q") for seat in partition.seats}
        firsts: dict[str, str] = {}
        is_readings = topic == self._topics.readings
        for message in messages(self._bootstrap, topic, number):
            found.records += 1
            offset = message.offset() or 0
            try:
                record = self._reader.read(headers_of(message), message.value())
            except RecordError:
                found.unreadable += 1
                partition.next = offset + 1
                continue
            if is_readings:
                inputs.take(record)
            for result in partition.take(offset, record):
                name = result.seat.name
                for action in result.actions:
                    self._dead_letters += isinstance(action, DeadLetter)
                    event = self._results[name].event(action, result.at_ms)
                    if event is None:
                        continue
                    retain = event.topic != "" and getattr(action, "retain", False)
                    headers, value = self._writer.written(event, record.received_ms, Origin(), retain=retain)
                    code = digest(event.device or name, [*headers, ("processor", name.encode())], value)
                    stands, place = stood.digests.get((number, name), array("Q")), len(told[name])
                    if name not in firsts and (place >= len(stands) or stands[place] != code):
                        what = f"{event.kind.value} {event.device or event.topic}"
                        firsts[name] = (
                            f"{name}, partition {number}, result {place} of {len(stands)}: {what}, from {topic}@{offset}"
                        )
                    told[name].append(code)
        for name, codes in told.items():
            found.by_processor[name] += len(codes)
            stands = stood.digests.pop((number, name), array("Q"))
            found.results.add(results_compared(codes, stands, firsts.get(name, f"{name}, partition {number}: more at the end")))
        return partition


def results_compared(told: "array[int]", stands: "array[int]", first: str) -> Difference:
    """Return what differs between the results of the replay and those that stand in the log; another order differs too."""
    if told == stands:
        return Difference(len(told))
    wanted, present = Counter(told), Counter(stands)
    lost, extra = (wanted - present).total(), (present - wanted).total()
    return Difference(len(told), lost, extra, 0 if lost or extra else 1, first)


def states_compared(wanted: Mapping[str, bytes], left: Mapping[str, bytes], number: int) -> Difference:
    """Return what differs between the states of the replay and those that the run has left, byte by byte."""
    found = Difference(len(wanted), len(wanted.keys() - left.keys()), len(left.keys() - wanted.keys()))
    for key in sorted(wanted.keys() & left.keys()):
        if wanted[key] != left[key]:
            found.different += 1
            at = next((n for n, (one, two) in enumerate(zip(wanted[key], left[key], strict=False)) if one != two), -1)
            part = slice(max(at - 60, 0), at + 60)
            found.first = found.first or f"{key} in partition {number}: replay …{wanted[key][part]!r}, run …{left[key][part]!r}"
    if not found.first and found.total:
        found.first = f"partition {number}: {sorted(wanted.keys() ^ left.keys())[:3]}"
    return found
