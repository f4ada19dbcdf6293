"""A store in memory, as far as a replay asks it."""

from collections.abc import Iterator, Sequence

from cnctwin.memory.store.contract import Message, Series, Snapshot
from sparkplug.host_session import EventKind, HostEvent


class MemoryStore:
    """Messages in order of arrival, and snapshots."""

    def __init__(self, messages: Sequence[Message] = (), snapshots: Sequence[Snapshot] = ()) -> None:
        self.log = list(messages)
        self.snapshots = list(snapshots)

    def machines(self) -> list[str]:
        """All machines, by name."""
        return sorted({event.device for _, event in self.log if event.device})

    def series(self, machine: str) -> list[Series]:
        """The signals of a machine."""
        found: dict[tuple[str, str], Series] = {}
        for _, event in self.log:
            for reading in event.readings if event.device == machine else ():
                key, at_us = (event.node.node, reading.name), reading.timestamp_ms * 1000
                known = found.get(key)
                first_us, last_us = (at_us, at_us) if known is None else (min(known.first_us, at_us), max(known.last_us, at_us))
                found[key] = Series(machine, event.node.node, reading.name, reading.unit, first_us, last_us)
        return list(found.values())

    def messages(self, machine: str, from_ms: int, to_ms: int) -> Iterator[Message]:
        """What came of a machine, and the holes of nodes."""
        for message in self.log:
            if from_ms <= message.received_ms < to_ms and message.event.device in {machine, None}:
                yield message

    def snapshot_before(self, processor: str, unit: str, at_ms: int) -> Snapshot | None:
        """The last one before a moment."""
        kept = [s for s in self.snapshots if (s.processor, s.unit) == (processor, unit) and s.received_ms < at_ms]
        return max(kept, key=lambda snapshot: snapshot.received_ms, default=None)


def is_hole(event: HostEvent) -> bool:
    """Return whether messages of a node were lost."""
    return event.kind is EventKind.HOLE
