"""The fold over a store gives what the live processor published, and says what the store cannot know."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from cnctwin.figures.documents import PartTold, ShiftTold, read_records
from cnctwin.figures.folding import folded
from cnctwin.memory.store.contract import Message, Store
from cnctwin.memory.store.opening import open_store
from processors.actions import Publish
from processors.production.processor import PROCESSOR
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.topics import NodeId
from tests.processors.streams import T0_MS, birth, data, death, engine_of
from twin.vocabulary.nodes import HISTORIAN_NODE
from twin.vocabulary.twin_signals import PRODUCTION

CALENDAR = """
time_zone = "UTC"
[shifts.early]
days = ["mon", "tue", "wed", "thu", "fri", "sat", "sun"]
start = "13:51"
end = "14:51"
[shifts.late]
days = ["mon", "tue", "wed", "thu", "fri", "sat", "sun"]
start = "14:51"
end = "15:51"
"""
IDLE = {"exec_state": "READY", "controller_mode": "AUTOMATIC", "program": "O1", "spindle_power_kw": 1.0}


@pytest.fixture
def table(tmp_path: Path) -> dict[str, object]:
    path = tmp_path / "calendar.toml"
    path.write_text(CALENDAR, encoding="utf-8")
    return {"calendar": str(path), "ideal_s": {"O1": 90.0}}


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    opened = open_store(tmp_path / "store", writable=True)
    yield opened
    opened.close()


def _two_shifts() -> list[HostEvent]:
    told = [birth(0.0, **IDLE)]
    for n in range(70):
        told += [data(100.0 * n + 10, exec_state="ACTIVE"), data(100.0 * n + 80, exec_state="READY", part_quality=f"good {n}")]
    return told


def _kept(store: Store, events: Sequence[HostEvent]) -> None:
    store.append([Message(event.timestamp_ms, event) for event in events])


def _read(texts: Sequence[str]) -> tuple[list[ShiftTold], list[PartTold]]:
    shifts, parts, refused = read_records(texts)
    assert refused == 0
    return shifts, parts


def test_the_fold_over_a_store_gives_what_was_published_live(store: Store, table: dict[str, object]) -> None:
    stream = _two_shifts()
    _kept(store, stream)
    engine, live = engine_of(PROCESSOR, **table), []
    for event in stream:
        actions = engine.silence(event.timestamp_ms / 1000 - 0.025) + engine.feed(event, event.timestamp_ms / 1000)
        live += [
            str(change.value)
            for action in actions
            if isinstance(action, Publish)
            for change in action.changes
            if change.name == PRODUCTION
        ]
    told = folded(store, "okuma", T0_MS, T0_MS + 7_200_000, table)
    assert told[:-1] == live
    shifts, parts = _read(told)
    assert [(one.shift, one.over, one.production_s) for one in shifts] == [("early", True, 2520.0), ("late", False, 2380.0)]
    assert len(parts) == 70
    assert {one.active_s for one in parts} == {70.0}


def test_a_stretch_begins_with_its_shift_and_what_held_before_it_is_known(store: Store, table: dict[str, object]) -> None:
    _kept(store, _two_shifts())
    whole, _ = _read(folded(store, "okuma", T0_MS, T0_MS + 7_200_000, table))
    late, _ = _read(folded(store, "okuma", T0_MS + 5_000_000, T0_MS + 7_200_000, table))
    assert [one.shift for one in late] == ["late"]
    assert late[0].production_s == whole[1].production_s
    assert late[0].unknown_s == 0.0


def test_time_in_which_the_memory_was_away_is_unknown(store: Store, table: dict[str, object]) -> None:
    hole = HostEvent(EventKind.HOLE, NodeId("cnc", HISTORIAN_NODE), "okuma", T0_MS + 500_000, (), "the historian began")
    stream = [birth(0.0, **IDLE), data(10.0, exec_state="ACTIVE"), data(100.0, spindle_power_kw=2.0), hole]
    stream += [birth(500.0, **IDLE | {"exec_state": "ACTIVE"}), data(560.0, spindle_power_kw=3.0)]
    _kept(store, stream)
    ((shift,), _) = _read(folded(store, "okuma", T0_MS, T0_MS + 600_000, table))
    assert (shift.production_s, shift.unknown_s) == (150.0, 400.0)


def test_a_dead_machine_is_unknown_before_the_stretch_and_in_it(store: Store, table: dict[str, object]) -> None:
    _kept(
        store,
        [birth(0.0, **IDLE), data(10.0, exec_state="ACTIVE"), death(3000.0), birth(4000.0, **IDLE), data(4100.0, program="O2")],
    )
    ((shift,), _) = _read(folded(store, "okuma", T0_MS + 3_700_000, T0_MS + 4_200_000, table))
    assert (shift.shift, shift.planned_s, shift.unknown_s) == ("late", 500.0, 400.0)


def test_what_an_edge_sends_late_is_folded_at_its_own_time(store: Store, table: dict[str, object]) -> None:
    """Offline from 100 s to 1000 s. At 90 s it stopped, and nobody heard it; from 200 s on it ran again."""
    live = [birth(0.0, **IDLE), data(10.0, exec_state="ACTIVE"), death(100.0)]
    late = [data(90.0, history=True, exec_state="FEED_HOLD"), data(200.0, history=True, exec_state="ACTIVE")]
    late += [data(700.0, history=True, spindle_power_kw=2.0)]
    back = [birth(1000.0, **IDLE | {"exec_state": "ACTIVE"}), data(1060.0, exec_state="READY"), data(1100.0, program="O2")]
    received = [(one.timestamp_ms, one) for one in (*live, *back)] + [(T0_MS + 1_001_000, one) for one in late]
    store.append([Message(at_ms, one) for at_ms, one in sorted(received, key=lambda pair: pair[0])])
    ((shift,), _) = _read(folded(store, "okuma", T0_MS, T0_MS + 1_200_000, table))
    assert shift.production_s == 90.0 + 860.0  # what the live processor took for running up to the death, it cannot take back
    assert shift.unknown_s == 100.0


def test_late_data_of_a_machine_that_was_heard_changes_nothing(store: Store, table: dict[str, object]) -> None:
    stream = _two_shifts()
    _kept(store, stream)
    before = folded(store, "okuma", T0_MS, T0_MS + 7_200_000, table)
    again = [data(100.0 * n + 40, history=True, exec_state="STOPPED") for n in range(5)]
    store.append([Message(T0_MS + 7_100_000, event) for event in again])
    assert folded(store, "okuma", T0_MS, T0_MS + 7_200_000, table) == before


def test_a_stretch_without_a_message_has_no_figures(store: Store, table: dict[str, object]) -> None:
    _kept(store, _two_shifts())
    assert folded(store, "okuma", T0_MS + 10**10, T0_MS + 10**10 + 7_200_000, table) == []


def test_what_is_no_record_is_left_out_and_counted() -> None:
    assert read_records(["", "[]", '{"kind": "shift"}', '{"kind": "part", "id": 1}']) == ([], [], 4)
