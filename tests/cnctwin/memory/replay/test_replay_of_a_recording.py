"""A recording goes into a store as if an edge had said it, and the processors run over it twice with the same bytes."""

from pathlib import Path

import pytest

from cnctwin.errors import UsageError
from cnctwin.importing.into_store import import_recording
from cnctwin.memory.replay import replay
from cnctwin.memory.store.opening import open_store
from sparkplug.host_session import EventKind
from tests.cnctwin.memory.replay.mazak import mazak_file, mazak_hours

PROCESSORS = (
    "alerts",
    "cutting_force",
    "events",
    "gap",
    "joint_anomaly",
    "residual",
    "rules",
    "thermal",
    "tool_change_detector",
    "vibration",
)

LINES = 4000


def test_a_recording_comes_out_of_the_store_as_an_edge_said_it_and_replays_twice_the_same(tmp_path: Path) -> None:
    store = open_store(tmp_path / "store", writable=True)
    try:
        imported = import_recording(store, *mazak_file(tmp_path, LINES), "okuma")
        kept = list(store.messages("okuma", 0, 2**50))
        first, second = (replay(store, "okuma", imported.from_ms, imported.to_ms + 1, PROCESSORS) for _ in range(2))
    finally:
        store.close()
    assert kept == mazak_hours(tmp_path, LINES)
    assert (kept[0].event.kind, {one.event.kind for one in kept[1:]}) == (EventKind.BIRTH, {EventKind.DATA})
    assert all(not reading.is_historical for one in kept for reading in one.event.readings)
    assert (imported.stored, imported.refused, imported.messages) == (imported.samples, 0, len(kept))
    assert first.sha256 == second.sha256
    assert {one.name: one.dead_letters for one in first.processors} == dict.fromkeys(PROCESSORS, 0)
    assert {one.name for one in first.processors if one.recomputed} >= {"events", "thermal", "rules", "cutting_force"}
    assert first.speed > 10.0


def test_a_recording_that_is_not_there_is_named(tmp_path: Path) -> None:
    store = open_store(tmp_path / "store", writable=True)
    try:
        with pytest.raises(UsageError, match="there is no recording"):
            import_recording(store, tmp_path / "none.txt", None, None)
    finally:
        store.close()
