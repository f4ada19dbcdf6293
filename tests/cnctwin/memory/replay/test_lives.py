"""Of which life of a processor a snapshot tells."""

import json
from dataclasses import dataclass

from cnctwin.memory.replay.lives import births_of_life
from cnctwin.memory.replay.log import Mark
from cnctwin.memory.store.contract import Snapshot
from processors.discovery import find
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.topics import NodeId

THERMAL = find("thermal")
TWIN, EDGE = NodeId("cnc", "twin-thermal"), NodeId("cnc", "edge-vmc")


@dataclass
class Kept:
    """A store that keeps snapshots."""

    snapshots: list[Snapshot]

    def snapshot_before(self, processor: str, unit: str, at_ms: int) -> Snapshot | None:
        before = [one for one in self.snapshots if one.received_ms < at_ms]
        return before[-1] if before else None


def snapshot(received_ms: int, birth_ms: int) -> Snapshot:
    document = {"live": {"machines": {"vmc": {"births": {str(EDGE): birth_ms}}}}}
    return Snapshot("thermal", "vmc", received_ms, json.dumps(document).encode())


def mark(place: int, received_ms: int, kind: EventKind, node: NodeId = EDGE) -> Mark:
    return Mark(place, received_ms, HostEvent(kind, node, "vmc", received_ms, detail="edge node offline"))


def test_a_life_that_came_after_the_stretch_says_nothing_of_it() -> None:
    store = Kept([snapshot(1_000, 900), snapshot(60_000, 59_000)])  # it was killed at 50 s, and began again
    found = [mark(1, 900, EventKind.BIRTH), mark(9, 30_000, EventKind.BIRTH)]
    assert births_of_life(store, THERMAL, ["vmc"], found, 0, 10) == ({("vmc", str(EDGE)): 900}, 1_000)  # type: ignore[arg-type]


def test_a_life_that_ends_within_the_stretch_is_told_by_its_last_snapshot() -> None:
    store = Kept([snapshot(1_000, 900), snapshot(20_000, 905), snapshot(60_000, 59_000)])
    found = [mark(1, 900, EventKind.BIRTH), mark(5, 25_000, EventKind.DEATH, TWIN), mark(9, 70_000, EventKind.BIRTH)]
    assert births_of_life(store, THERMAL, ["vmc"], found, 0, 5) == ({("vmc", str(EDGE)): 905}, 20_000)  # type: ignore[arg-type]
