"""Messages that are alike lie in one row; what is unusual does not, and both come back as they were said."""

import math
import sqlite3
import struct
from pathlib import Path
from typing import Any

import pytest

from cnctwin.memory.store.chunk import read_chunks
from cnctwin.memory.store.contract import Message, Query
from cnctwin.memory.store.database import SCHEMA, VERSION, insert
from cnctwin.memory.store.embedded import EmbeddedStore
from sparkplug.quality import Quality
from tests.cnctwin.memory.store.told import BAD, HOUR_MS, T0_MS, reading, steady, told


def rows(store: EmbeddedStore) -> tuple[int, int]:
    """Return the number of chunks, and of samples that stand in rows of their own."""
    with store._readers.snapshot() as db:
        return tuple(db.execute(f"SELECT count(*) FROM {name}").fetchone()[0] for name in ("chunks", "samples"))  # type: ignore[return-value]


def test_a_second_of_a_machine_is_one_row(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    store.append(steady(0, 10))
    assert rows(store) == (1, 0)
    assert list(store.messages("vmc", 0, T0_MS + HOUR_MS)) == steady(0, 10)


def test_a_chunk_does_not_reach_over_a_minute_so_that_an_hour_can_be_sealed(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    store.append(steady(59_000, 20))
    with store._readers.snapshot() as db:
        minutes = [{ms // 60_000 for ms in chunk.stamps(0)} for chunk in read_chunks(db, 1, T0_MS, T0_MS + HOUR_MS)]
    assert minutes == [{T0_MS // 60_000}, {T0_MS // 60_000 + 1}]


@pytest.mark.parametrize(
    ("value", "chunks"),
    [
        (1.5, 1), (-0.0, 1), (math.nan, 1), (struct.unpack("<d", b"\x01\x00\x00\x00\x00\x00\xf8\xff")[0], 1), (math.inf, 1),
        (2**63 - 1, 1), (-(2**63) + 1, 1), (True, 1), ("", 1), ("Ω\0ü", 1),
        (-(2**63), 0), (2**64, 0), (None, 0), ((1.0, 2.0), 0), (b"\x00", 0),
    ],
)  # fmt: skip
def test_a_value_comes_back_bit_for_bit(tmp_path: Path, value: Any, chunks: int) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    said = [told([reading("x_mm", value, 0)], 0), told([reading("x_mm", 7.0, 5)], 5)]
    store.append(said[:1])
    assert rows(store) == (chunks, 1 - chunks)
    store.append(said[1:])
    assert repr(list(store.messages("vmc", 0, T0_MS + HOUR_MS))) == repr(said)
    [column] = store.query(Query("vmc", ("x_mm",), T0_MS, T0_MS + 5))
    assert repr(column.value) == repr([value]) and type(column.value[0]) is type(value)
    if isinstance(value, float):
        assert struct.pack("<d", column.value[0]) == struct.pack("<d", value)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "readings",
    [
        [reading("y", 1.0, 0), reading("x_mm", 2.0, 0)],  # not in the order of their series, which are made in this one
        [reading("x_mm", 1.0, 3), reading("y", 2.0, 1), reading("z", 3, 2)],  # stamps of their own
        [reading("x_mm", 1.0, 0, BAD, "outside 0 to 1"), reading("y", True, 0)],
        [reading("x_mm", 1.0, 0, history=True), reading("y", "a", 0, history=True)],
        [reading("x_mm", 1.0, 0), reading("twin/gap", 1.0, 0)],  # kept apart
        [reading("x_mm", 1.0, 0), reading("x_mm", 2.0, 1)],  # a signal twice
    ],
)
def test_a_message_comes_back_in_its_order(tmp_path: Path, readings: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.memory.store.sealed.sealing.SAMPLES_MIN", 1)
    monkeypatch.setattr("cnctwin.memory.store.sealed.sealing.DAY_SAMPLES_MIN", 1)
    store = EmbeddedStore(tmp_path, writable=True)
    before = told([reading("x_mm", 0.0, -9), reading("y", "b", -8), reading("z", 0, -7)], -9)
    said = [before, told(readings, 4)]
    store.append(said)
    assert list(store.messages("vmc", 0, T0_MS + HOUR_MS)) == said
    assert store.tidy(T0_MS + 48 * HOUR_MS).sealed == 2
    assert rows(store) == (0, 0)
    assert list(store.messages("vmc", 0, T0_MS + HOUR_MS)) == said


def test_kinds_of_messages_that_take_turns_are_one_series_in_time(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    said = [told([reading("x_mm", float(n), n), *([reading("y", n, n)] if n % 2 else [])], n, lag_ms=1) for n in range(0, 100)]
    store.append(said)
    assert rows(store) == (2, 0)
    [column] = store.query(Query("vmc", ("x_mm",), T0_MS + 10, T0_MS + 20))
    assert column.value == [float(n) for n in range(10, 20)]
    [column] = store.query(Query("vmc", ("x_mm",), T0_MS, T0_MS + 100, 10))
    assert (column.value[0], column.low[0], column.high[0], column.count) == (4.5, 0.0, 9.0, [10] * 10)
    assert list(store.messages("vmc", 0, T0_MS + HOUR_MS)) == said


def test_what_is_said_again_or_late_is_compared_with_what_lies_in_chunks(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    said = steady(0, 50)
    store.append(said)
    assert store.append(said[:20]) == (0, 60, 0)
    again = [Message(m.received_ms, m.event._replace(readings=tuple(r._replace(is_historical=True) for r in m.event.readings)))
             for m in said[20:]]  # fmt: skip
    assert store.append([*steady(5_000, 5, start=50), *again]) == (15, 90, 0), "in one batch with new ones"
    other = told([reading("x_mm", -1.0, 100, history=True)], 100)
    assert store.append([other]) == (1, 0, 0)
    [column] = store.query(Query("vmc", ("x_mm",), T0_MS + 100, T0_MS + 101))
    assert column.value == [0.037, -1.0] and column.t_us == [(T0_MS + 100) * 1000, (T0_MS + 100) * 1000 + 1]


def test_a_window_says_the_worst_of_its_chunk(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    store.append([told([reading("x_mm", 1.0, 0)], 0), told([reading("x_mm", 9.0, 1, BAD, "outside")], 1)])
    [column] = store.query(Query("vmc", ("x_mm",), T0_MS, T0_MS + 10, 10))
    assert (column.value, column.quality, column.reason, column.count) == ([1.0], [Quality.BAD], ["outside"], [2])


def old_store(place: Path) -> None:
    """A store of version 1, which knows no chunks, with what a store of today would have in one."""
    store = EmbeddedStore(place, writable=True)
    store.append(steady(0, 3))
    store.close()
    with sqlite3.connect(place / "store.sqlite") as db:
        events, samples = [], []
        for chunk in read_chunks(db, 1, T0_MS, T0_MS + HOUR_MS):
            for number, came, stamp in zip(chunk.numbers(), chunk.received_ms(), chunk.message_stamps(), strict=True):
                events.append((number, came, 1, 1, 1, stamp, None, None, None, stamp, stamp))
            for column, sid in enumerate(chunk.sids):
                told = zip(chunk.stamps(column), chunk.values(column), chunk.numbers(), strict=True)
                samples += [(sid, stamp * 1000, value, 0, number) for stamp, value, number in told]
        insert(db, "INSERT INTO events VALUES", events)
        insert(db, "INSERT INTO samples VALUES", samples)
        db.execute("DROP TABLE chunks")
        db.execute("PRAGMA user_version = 1")
    db.close()


def test_a_store_of_before_there_were_chunks_is_read_and_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.memory.store.sealed.sealing.DAY_SAMPLES_MIN", 1)
    old_store(tmp_path)
    reader = EmbeddedStore(tmp_path)
    assert list(reader.messages("vmc", 0, T0_MS + HOUR_MS)) == steady(0, 3)
    assert reader.status().samples == 9
    store = EmbeddedStore(tmp_path, writable=True)
    store.append(steady(300, 3, start=3))
    assert list(reader.messages("vmc", 0, T0_MS + HOUR_MS)) == steady(0, 6), "the reader of before sees what is new"
    assert list(store.messages("vmc", 0, T0_MS + HOUR_MS)) == steady(0, 6)
    assert store.tidy(T0_MS + 48 * HOUR_MS).sealed == 1
    assert list(store.messages("vmc", 0, T0_MS + HOUR_MS)) == steady(0, 6)
    with store._readers.snapshot() as db:
        assert db.execute("PRAGMA user_version").fetchone() == (VERSION,)


def test_many_rows_are_inserted_in_few_statements() -> None:
    db = sqlite3.connect(":memory:", isolation_level=None)
    db.executescript(SCHEMA)
    said: list[str] = []
    db.set_trace_callback(said.append)
    insert(db, "INSERT INTO snapshots VALUES", [("thermal", "vmc", n, b"{}") for n in range(1000)])
    assert db.execute("SELECT count(*), sum(received_ms) FROM snapshots").fetchone() == (1000, 499_500)
    assert len(said) < 12
    db.close()
