"""The readings of the log beside what the witness has seen: gaps in the numbers of a life, and messages that never came.

At a kill of the bridge messages are lost: on the broker nobody has subscribed until it is back, and data that come before the
machine's births cannot be read. Of a machine that is one run of messages without a break. Part of it is older than the kill:
what the bridge had taken in, and Kafka had not acknowledged. Whatever else is missing is a fault.
"""

from array import array
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from benchmarks.kafka.witness import Noted
from sparkplug.host_event import EventKind
from sparkplug.records.record import Record
from twin.vocabulary.nodes import is_twin_node

EDGE_MS = 1500
"""A machine that stands says something once a second: its last message before the kill may be so old."""


class Kill(NamedTuple):
    """A bridge that was killed, and the start of the next one."""

    killed_ms: int
    started_ms: int


@dataclass(slots=True)
class _Machine:
    keys: set[tuple[int, int, int]] = field(default_factory=set)
    received_ms: "array[int]" = field(default_factory=lambda: array("q"))
    stamps_ms: "array[int]" = field(default_factory=lambda: array("q"))
    life: int = -1
    seq: int = -1


@dataclass(slots=True)
class Missing:
    """The messages that the witness saw and the log does not hold."""

    in_memory: int = 0
    unbridged: int = 0
    otherwise: int = 0
    first: str = ""
    blind_s: list[float] = field(default_factory=list)
    """The time, of each machine and kill, from the kill to the first data that came again."""


class Inputs:
    """See the module."""

    def __init__(self) -> None:
        self.data = self.holes = self.gaps = self.repeated = 0
        self.first_gap = ""
        self._machines: dict[str, _Machine] = {}

    def take(self, record: Record) -> None:
        """Take a record of the readings, in the order of its partition."""
        event, (_, birth_ms, seq) = record.event, record.origin
        if event is None or event.device is None or is_twin_node(event.node.node):
            return
        machine = self._machines.setdefault(event.device, _Machine())
        if event.kind is EventKind.HOLE:
            self.holes += 1
            machine.seq = -1
            return
        if birth_ms != machine.life:
            machine.life, machine.seq = birth_ms, -1
        if event.kind is EventKind.DATA:
            key = birth_ms, event.timestamp_ms, seq
            if key in machine.keys:
                self.repeated += 1
                return
            self.data += 1
            machine.keys.add(key)
            machine.received_ms.append(record.received_ms)
            machine.stamps_ms.append(event.timestamp_ms)
        if seq < 0:
            return
        if machine.seq >= 0 and seq != (machine.seq + 1) % 256:
            self.gaps += 1
            self.first_gap = self.first_gap or f"{event.device}: {seq} after {machine.seq} in the life of {birth_ms}"
        machine.seq = seq

    def missing(self, noted: Noted, kills: Sequence[Kill]) -> Missing:
        """Return what the witness saw and the log does not hold."""
        found = Missing()
        for name in noted.messages:
            machine = self._machines.get(name, _Machine())
            resumed = [(kill.killed_ms, _resumed_ms(machine, kill)) for kill in kills]
            found.blind_s += [(stamp_ms - killed_ms) / 1000 for killed_ms, stamp_ms in resumed if stamp_ms is not None]
            run: list[int] = []
            for key in noted.of(name):
                if key not in machine.keys:
                    run.append(key[1])
                elif run:
                    _judge(found, name, run, resumed)
                    run = []
            if run:
                _judge(found, name, run, resumed)
        return found


def _resumed_ms(machine: _Machine, kill: Kill) -> int | None:
    """Return the stamp of the first data of a machine that a new bridge took in."""
    place = bisect_left(machine.received_ms, kill.started_ms)
    return machine.stamps_ms[place] if place < len(machine.stamps_ms) else None


def _judge(found: Missing, name: str, run: list[int], resumed: Sequence[tuple[int, int | None]]) -> None:
    for killed_ms, resumed_ms in resumed:
        if run[-1] >= killed_ms - EDGE_MS and (resumed_ms is None or run[0] <= resumed_ms):
            older = sum(stamp_ms < killed_ms for stamp_ms in run)
            found.in_memory += older
            found.unbridged += len(run) - older
            return
    found.otherwise += len(run)
    found.first = found.first or f"{name}: {len(run)} messages from {run[0]} on"
