"""Clocks that stand in the past or run ahead, files that are gone, a database that is an old copy, damaged, or begun again."""

import shutil
import sqlite3
from pathlib import Path
from typing import Any

import pytest

from cnctwin.memory.store import writer
from cnctwin.memory.store.contract import Message, Pinned, Query, Snapshot, StoreError
from cnctwin.memory.store.embedded import EmbeddedStore
from cnctwin.memory.store.retention import DAY_MS, Retention
from cnctwin.memory.store.sweep import past
from sparkplug.host_session import EventKind
from tests.cnctwin.memory.store.told import HOUR_MS, T0_MS, reading, steady, told

YEARS_MS = 5 * 365 * DAY_MS
MIDNIGHT_MS = T0_MS // DAY_MS * DAY_MS


@pytest.fixture(autouse=True)
def _a_file_an_hour(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.memory.store.sealed.sealing.SAMPLES_MIN", 1)


def three_hours(*, later_ms: int = 0) -> list[Message]:
    """A machine from T0_MS on, heard so much later."""
    return [Message(message.received_ms + later_ms, message.event) for message in steady(0, 90, every_ms=100_000)]


def count(store: EmbeddedStore, machine: str = "vmc") -> int:
    [column] = store.query(Query(machine, ("x_mm",), T0_MS - DAY_MS, T0_MS + DAY_MS))
    return len(column.t_us)


def named(folder: Path, ending: str) -> int:
    return len(list(folder.rglob("*" + ending)))


def test_a_machine_whose_clock_stands_years_back_is_kept_as_long_as_any_other(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True, retention=Retention(raw_days=30.0))
    store.append(three_hours(later_ms=YEARS_MS))
    now_ms = T0_MS + YEARS_MS + 5 * HOUR_MS
    assert store.tidy(now_ms)[:2] == (3, 0)
    assert store.append([Message(now_ms, m.event) for m in steady(50_000, 10)]) == (30, 0, 0), (
        "and its next boot begins there again"
    )
    store.tidy(now_ms + HOUR_MS)
    assert count(store) == 100
    assert store.tidy(now_ms + 29 * DAY_MS).swept == 0
    assert store.tidy(now_ms + 31 * DAY_MS).swept == 3


def test_what_a_clock_far_ahead_has_stamped_is_sealed_a_day_after_it_came(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    store.append(three_hours(later_ms=-YEARS_MS))
    now_ms = T0_MS - YEARS_MS
    assert store.tidy(now_ms + 6 * HOUR_MS).sealed == 0
    assert store.tidy(now_ms + 2 * DAY_MS).sealed == 3
    assert count(store) == 90


def test_the_hour_that_runs_is_not_sealed_for_being_quiet(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    store.append(steady(0, 5))
    assert store.tidy(T0_MS + 40 * 60_000).sealed == 0


def test_a_birth_that_is_past_its_time_does_not_stand_in_the_way_of_its_samples(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cnctwin.memory.store.sealed.sealing.SAMPLES_MIN", 20_000)
    store = EmbeddedStore(tmp_path, writable=True, retention=Retention(raw_days=1.0))
    at_ms = MIDNIGHT_MS - T0_MS + 60_000
    store.append([told([reading("x_mm", 1.0, at_ms)], at_ms, kind=EventKind.BIRTH), *steady(at_ms + 1000, 30)])
    store.tidy(MIDNIGHT_MS + DAY_MS + 120_000)  # the birth is a day old, and its hour not sealed yet
    assert store.tidy(MIDNIGHT_MS + DAY_MS + 30 * 60_000).sealed == 1


def test_long_pins_do_not_hide_what_may_go(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True, retention=Retention(raw_days=1.0))
    store.append(steady(0, 2))
    db = store._writer.db
    columns = "class, machine, from_ms, to_ms, name, state, bytes, crc, samples, first_number, last_number, first_received_ms"
    for hour in range(1000):
        from_ms = T0_MS + hour * HOUR_MS
        row = (from_ms, from_ms + HOUR_MS, str(hour), from_ms, from_ms)
        db.execute(
            f"INSERT INTO files({columns}, last_received_ms, columns) VALUES (0, 1, ?, ?, ?, 0, 9, 0, 1, 1, 1, ?, ?, '{{}}')", row
        )
    for week in range(5):
        from_ms = T0_MS + week * 7 * DAY_MS
        store.pin(Pinned("vmc", from_ms, from_ms + 7 * DAY_MS, "a week of it"))
    free, pinned = past(db, Retention(raw_days=1.0), T0_MS + 100 * DAY_MS)
    assert (len(free), pinned) == (160, 840)


def test_snapshots_go_with_the_raw_that_they_would_be_needed_for(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True, retention=Retention(raw_days=10.0))
    for day in range(30):
        store.keep_snapshot(Snapshot("thermal", "vmc", T0_MS + day * DAY_MS, b"state"))
    store.pin(Pinned("vmc", T0_MS + 5 * DAY_MS + HOUR_MS, T0_MS + 5 * DAY_MS + 2 * HOUR_MS, "score 9.1"))
    store.tidy(T0_MS + 30 * DAY_MS)
    kept = [int(ms - T0_MS) // DAY_MS for (ms,) in store._writer.db.execute("SELECT received_ms FROM snapshots ORDER BY 1")]
    assert kept == [5, *range(18, 30)]


def test_descriptions_of_machines_stay_whatever_goes(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True, retention=Retention(raw_days=10.0))
    for hour in range(3):
        store.keep_snapshot(Snapshot("description", "vmc/live", T0_MS + hour * HOUR_MS, b"%d" % hour))
    store.tidy(T0_MS + 400 * DAY_MS)
    kept = [payload for (payload,) in store._writer.db.execute("SELECT payload FROM snapshots ORDER BY received_ms")]
    assert kept == [b"0", b"1", b"2"]


def sealed_store(folder: Path) -> None:
    store = EmbeddedStore(folder, writable=True)
    store.append(three_hours())
    assert store.tidy(T0_MS + 5 * HOUR_MS).sealed == 3
    store.close()


def test_an_older_copy_of_the_database_costs_no_sealed_hour(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    store.append(steady(0, 3))
    store.close()
    shutil.copy(tmp_path / "store.sqlite", tmp_path / "copy")
    sealed_store(tmp_path)
    shutil.copy(tmp_path / "copy", tmp_path / "store.sqlite")
    EmbeddedStore(tmp_path, writable=True).close()
    assert named(tmp_path, ".parquet.unnamed") == 3


def test_nor_does_a_database_that_was_begun_by_a_program_that_knows_no_parquet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sealed_store(tmp_path)
    for path in tmp_path.glob("store.sqlite*"):
        path.unlink()
    with monkeypatch.context() as light:
        light.setattr(writer, "extra_is_there", lambda: False)
        store = EmbeddedStore(tmp_path, writable=True)
        store.append(steady(10_000_000, 2))
        store.close()
    EmbeddedStore(tmp_path, writable=True).close()
    assert named(tmp_path, ".parquet.unnamed") == 3


def test_what_a_kill_has_left_over_goes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    store.append(three_hours())

    def killed(*_: Any) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as dying:
        dying.setattr("cnctwin.memory.store.sealed.sealing.Sealer._remove", killed)
        with pytest.raises(KeyboardInterrupt):
            store.tidy(T0_MS + 5 * HOUR_MS)
    assert named(tmp_path, ".parquet") == 1
    store.close()
    store = EmbeddedStore(tmp_path, writable=True)
    assert named(tmp_path, ".parquet") == named(tmp_path, ".unnamed") == 0
    assert count(store) == 90


def test_a_sealed_file_that_is_gone_stops_neither_what_comes_nor_the_tidying(tmp_path: Path) -> None:
    sealed_store(tmp_path)
    store = EmbeddedStore(tmp_path, writable=True)
    for path in tmp_path.rglob("*.parquet"):
        path.unlink()
    late = [Message(T0_MS + 6 * HOUR_MS, message.event) for message in steady(50, 5)]
    assert store.append(late).stored == 15
    with pytest.raises(StoreError, match="is gone"):
        store.tidy(T0_MS + 2 * DAY_MS)
    store.tidy(T0_MS + 2 * DAY_MS + 60_000)
    assert count(store) == 5 and "set aside" in store.status().trouble


def test_sqlite_that_fails_while_tidying_is_a_store_that_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = EmbeddedStore(tmp_path, writable=True)

    def full(*_: Any) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    monkeypatch.setattr("cnctwin.memory.store.sealed.sealing.Sealer.due", full)
    with pytest.raises(StoreError, match="disk is full"):
        store.tidy(T0_MS)


def test_a_damaged_database_is_put_aside_also_after_a_stop_in_good_order(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    store.append(steady(0, 2000))
    store.close()
    with sqlite3.connect(tmp_path / "store.sqlite") as db:
        (page,) = db.execute("SELECT rootpage FROM sqlite_master WHERE name = 'chunks'").fetchone()
    db.close()
    with (tmp_path / "store.sqlite").open("r+b") as file:
        file.seek((page - 1) * 4096)
        file.write(b"\xff" * 4096)
    store = EmbeddedStore(tmp_path, writable=True)
    with pytest.raises(StoreError, match="malformed"):
        store.append(steady(1_000_000, 1))
    store.close()
    store = EmbeddedStore(tmp_path, writable=True)
    assert store.append(steady(1_000_000, 1)).stored == 3
    assert len(list(tmp_path.glob("store.sqlite.damaged-*"))) == 1


def test_a_batch_that_failed_leaves_nothing_in_memory(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    db = store._writer.db
    db.execute("CREATE TRIGGER no BEFORE INSERT ON chunks BEGIN SELECT RAISE(ABORT, 'no'); END")
    with pytest.raises(StoreError):
        store.append(steady(0, 2))
    db.execute("DROP TRIGGER no")
    store.append(steady(0, 2, machine="other"))
    store.append(steady(0, 2))
    assert count(store) == count(store, "other") == 2 and len(store.series("vmc")) == 3


def test_a_disk_that_has_little_left_is_said_before_raw_goes_for_it(tmp_path: Path) -> None:
    sealed_store(tmp_path)
    assert EmbeddedStore(tmp_path, free_bytes=lambda _: 10**10).status().trouble == ""
    assert "raw goes before its time" in EmbeddedStore(tmp_path, free_bytes=lambda _: 9 * 10**8).status().trouble


def test_a_reader_finds_the_store_that_was_begun_anew(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    store.append(steady(0, 2))
    reader = EmbeddedStore(tmp_path)
    assert reader.machines() == ["vmc"]
    store.close()
    for path in tmp_path.glob("store.sqlite*"):
        path.unlink()
    with pytest.raises(StoreError, match="is the store there"):
        reader.machines()
    store = EmbeddedStore(tmp_path, writable=True)
    store.append(steady(0, 2, machine="new"))
    assert reader.machines() == ["new"]
