"""Hours leave SQLite for Parquet, and nobody can tell by the answers."""

import threading
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from cnctwin.memory.store.contract import Message, Query, StoreError, Tidied
from cnctwin.memory.store.embedded import EmbeddedStore
from sparkplug.host_session import EventKind
from tests.cnctwin.memory.store.told import BAD, HOUR_MS, STALE, T0_MS, reading, steady, told

SIGNALS = ("x_mm", "exec_state", "twin_like")


def sealed(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*.parquet"))


def everything(store: EmbeddedStore) -> tuple[object, ...]:
    span = (T0_MS - HOUR_MS, T0_MS + 50 * HOUR_MS)
    asked = [store.query(Query("vmc", SIGNALS, *span, every_ms)) for every_ms in (None, 1000, 60_000, 7 * 60_000)]
    for column in (column for columns in asked[1:] for column in columns):
        column.value[:] = [
            float(f"{v:.12g}") if isinstance(v, float) else v for v in column.value
        ]  # sums differ in the last digit
    return (*asked, store.latest("vmc"), store.series("vmc"), list(store.messages("vmc", *span)))


def test_sealing_changes_no_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.memory.store.sealed.sealing.SAMPLES_MIN", 1)
    store = EmbeddedStore(tmp_path, writable=True)
    odd = [
        told(
            [reading("x_mm", None, 5_000_050, BAD, "UNAVAILABLE"), reading("exec_state", None, 5_000_050, BAD, "UNAVAILABLE")],
            5_000_050,
        ),
        told([reading("x_mm", 3.0, 5_000_100, STALE, "edge offline")], 5_000_100, kind=EventKind.DEATH),
        told([reading("twin_like", float("nan"), 5_000_200), reading("twin_like", float("inf"), 5_000_201)], 5_000_200),
    ]
    messages = steady(0, 1500, every_ms=4000)
    store.append(sorted([*messages, *odd], key=lambda m: m.event.timestamp_ms))
    before = everything(store)
    assert store.tidy(T0_MS + 3 * HOUR_MS).sealed == 2
    assert repr(everything(store)) == repr(before)
    assert [name.rpartition("/")[2] for name in sealed(tmp_path)] == ["06-07.1.parquet", "07-08.2.parquet"]
    store.close()
    store = EmbeddedStore(tmp_path)
    assert repr(everything(store)) == repr(before)
    store.close()


def test_figures_of_few_decimals_take_little(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    chance = np.random.default_rng(1)
    walk = np.cumsum(chance.integers(-20, 21, 36_000)) / 1000
    store.append([told([reading("x_mm", float(v), 100 * n)], 100 * n, lag_ms=30) for n, v in enumerate(np.round(walk, 3))])
    store.tidy(T0_MS + 3 * HOUR_MS)
    [name] = sealed(tmp_path)
    assert (tmp_path / name).stat().st_size < 2 * 36_000
    assert "s1e3" in pq.read_schema(tmp_path / name).names
    [column] = store.query(Query("vmc", ("x_mm",), T0_MS, T0_MS + HOUR_MS))
    assert column.value == np.round(walk, 3).tolist()
    store.close()


def test_an_hour_into_which_something_came_of_late_waits(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    came_ms = T0_MS + 40 * HOUR_MS
    store.append([Message(came_ms, m.event) for m in steady(0, 30)])
    assert store.tidy(came_ms + 599_000) == Tidied(0, 0, 0, 0)
    assert store.tidy(came_ms + 600_000).sealed == 1
    store.close()


def test_quiet_hours_wait_for_the_end_of_their_day(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    store.append(steady(0, 20) + steady(5 * HOUR_MS, 20))
    assert store.tidy(T0_MS + 10 * HOUR_MS).sealed == 0
    assert store.tidy(T0_MS + 18 * HOUR_MS + 600_000).sealed == 6
    assert sealed(tmp_path)[0].endswith("/06-12.1.parquet")
    store.close()


def test_late_history_is_merged_into_its_hour(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    live, late = steady(0, 600, every_ms=6000), steady(3000, 600, every_ms=6000, start=7)
    store.append(live)
    now_ms = T0_MS + 30 * HOUR_MS
    store.tidy(now_ms)
    [before] = [name for name in sealed(tmp_path) if name.startswith("cnc_raw")]
    history = [
        Message(now_ms, m.event._replace(readings=tuple(r._replace(is_historical=True) for r in m.event.readings)))
        for m in (*late, *live[:50])
    ]
    assert store.append(history) == (1800, 150, 0)
    assert len(store.query(Query("vmc", ("x_mm",), T0_MS, T0_MS + HOUR_MS))[0].t_us) == 1200
    store.tidy(now_ms + 2 * HOUR_MS)
    [after] = [name for name in sealed(tmp_path) if name.startswith("cnc_raw")]
    assert after != before
    assert store.append(history) == (0, 1950, 0)
    [column] = store.query(Query("vmc", ("x_mm",), T0_MS, T0_MS + HOUR_MS))
    assert column.t_us == sorted((m.event.timestamp_ms) * 1000 for m in (*live, *late))
    assert len(list(store.messages("vmc", 0, now_ms + HOUR_MS))) == 1200
    store.close()


def test_two_readers_see_each_sample_once_while_it_is_sealed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.memory.store.sealed.sealing.SAMPLES_MIN", 1)
    store = EmbeddedStore(tmp_path, writable=True)
    for hour in range(4):
        store.append(steady(hour * HOUR_MS, 1000, every_ms=3500))
    wanted = 4 * 1000
    seen: list[list[int]] = [[], []]
    stop = threading.Event()

    def look(counts: list[int]) -> None:
        reader = EmbeddedStore(tmp_path)
        while not stop.is_set():
            [column] = reader.query(Query("vmc", ("x_mm",), T0_MS, T0_MS + 5 * HOUR_MS, HOUR_MS))
            counts.append(sum(column.count))
        reader.close()

    lookers = [threading.Thread(target=look, args=(counts,)) for counts in seen]
    for looker in lookers:
        looker.start()
    for hour in range(1, 5):
        store.tidy(T0_MS + hour * HOUR_MS + 600_000)
        store.append(steady((hour - 1) * HOUR_MS + 250, 1))  # the sealed hour is written again for it
        wanted += 1
    store.tidy(T0_MS + 30 * HOUR_MS)
    stop.set()
    for looker in lookers:
        looker.join()
    for counts in seen:
        assert len(counts) > 2 and counts == sorted(counts) and counts[0] == 4000 and counts[-1] <= wanted
    [column] = store.query(Query("vmc", ("x_mm",), T0_MS, T0_MS + 5 * HOUR_MS, HOUR_MS))
    assert sum(column.count) == wanted
    store.close()


def test_a_damaged_file_is_named_and_the_rest_is_read(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cnctwin.memory.store.sealed.sealing.SAMPLES_MIN", 1)
    store = EmbeddedStore(tmp_path, writable=True)
    store.append(steady(0, 2_000, every_ms=3500))
    store.tidy(T0_MS + 30 * HOUR_MS)
    first, second = sealed(tmp_path)[:2]
    body = bytearray((tmp_path / first).read_bytes())
    body[len(body) // 2] ^= 0xFF
    (tmp_path / first).write_bytes(body)
    [column] = store.query(Query("vmc", ("x_mm",), T0_MS, T0_MS + 5 * HOUR_MS))
    assert len(column.t_us) == 2_000 - 1029
    assert [r.message for r in caplog.records] == [
        f"{tmp_path / first}: is damaged ({len(body)} bytes, {len(body)} were written); the answer is without it"
    ]
    assert first in store.status().trouble
    store.close()
    (tmp_path / second).write_bytes(b"")
    caplog.clear()
    store = EmbeddedStore(tmp_path, writable=True)
    assert second in caplog.text and (tmp_path / f"{second}.damaged").exists()
    assert second in store.status().trouble
    assert store.append(steady(HOUR_MS + 1, 10)).stored == 30
    store.close()


def test_a_damaged_database_is_set_aside_and_sealed_hours_are_taken_over(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cnctwin.memory.store.sealed.sealing.SAMPLES_MIN", 1)
    store = EmbeddedStore(tmp_path, writable=True)
    store.append(
        [told([reading("x_mm", None, 0, BAD, "not known yet")], 0, kind=EventKind.BIRTH), *steady(50, 2000, every_ms=3500)]
    )
    store.tidy(T0_MS + HOUR_MS + 600_000)
    span = (T0_MS, T0_MS + HOUR_MS)
    before = store.query(Query("vmc", SIGNALS, *span))
    messages = [
        m for m in store.messages("vmc", *span) if m.event.kind is EventKind.DATA and m.event.timestamp_ms < T0_MS + HOUR_MS
    ]
    store.close()
    (tmp_path / "store.sqlite").write_bytes(b"x" * 8192)
    (tmp_path / "store.sqlite-wal").unlink(missing_ok=True)
    store = EmbeddedStore(tmp_path, writable=True)
    assert "is damaged" in caplog.text and list(tmp_path.glob("store.sqlite.damaged-*"))
    assert store.query(Query("vmc", SIGNALS, *span)) == before
    assert list(store.messages("vmc", *span)) == messages
    assert store.append(steady(50, 100, every_ms=3500)) == (0, 300, 0)
    assert store.append(steady(2 * HOUR_MS, 100)).stored == 300
    assert store.latest("vmc")["x_mm"].t_us == (T0_MS + 2 * HOUR_MS + 9900) * 1000
    store.close()


def test_without_the_extra_sqlite_keeps_all_and_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.memory.store.extra.NEEDED", ("numpy", "no_such_package"))
    store = EmbeddedStore(tmp_path, writable=True)
    store.append(steady(0, 100))
    assert store.tidy(T0_MS + 30 * HOUR_MS) == Tidied(0, 0, 0, 0)
    assert "cnctwin[historian]" in store.status().trouble
    assert len(store.query(Query("vmc", ("x_mm",), T0_MS, T0_MS + HOUR_MS))[0].value) == 100
    assert len(list(store.messages("vmc", T0_MS, T0_MS + HOUR_MS))) == 100
    store.close()


def test_a_second_writer_is_refused_in_one_line(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    with pytest.raises(StoreError, match=r"process \d+ \(.*\) writes this store already, and only one may; end that one first$"):
        EmbeddedStore(tmp_path, writable=True)
    store.close()
    EmbeddedStore(tmp_path, writable=True).close()
    with pytest.raises(StoreError, match="there is no store"):
        EmbeddedStore(tmp_path / "elsewhere")


def test_a_full_disk_is_said_and_nothing_is_taken(tmp_path: Path) -> None:
    free = [10**12]
    store = EmbeddedStore(tmp_path, writable=True, free_bytes=lambda _: free[0])
    store.append(steady(0, 10))
    free[0] = 1000
    with pytest.raises(StoreError, match="the disk has 0 MB left, 200 MB are needed"):
        store.append(steady(1000, 10))
    assert "nothing more is kept until there is room" in store.status().trouble
    free[0] = 10**12
    assert store.append(steady(1000, 10)).stored == 30
    store.close()


def test_a_message_whose_metrics_are_of_many_days_makes_no_files_for_them(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True, margin_ms=0)
    days = [reading(f"signal_{n}", float(n), -n * 12 * HOUR_MS) for n in range(360)]
    store.append([told(days, 0, kind=EventKind.BIRTH), *steady(0, 50)])
    for _ in range(400):
        store.tidy(T0_MS + 5 * 24 * HOUR_MS)
    assert len(sealed(tmp_path)) <= 4, "only the day of the machine itself is worth files: what it said, and minutes of it"
    span = (T0_MS - 200 * 24 * HOUR_MS, T0_MS + HOUR_MS)
    for n, column in enumerate(store.query(Query("vmc", tuple(f"signal_{n}" for n in range(360)), *span))):
        assert column.value == [float(n)], "and all are there"
    store.close()


def test_a_stamp_far_ahead_is_refused_and_costs_what_follows_nothing(tmp_path: Path) -> None:
    store = EmbeddedStore(tmp_path, writable=True)
    ahead_ms = 900 * 365 * 24 * HOUR_MS
    done = store.append([told([reading("x_mm", 1.0, 0), reading("y_mm", 2.0, ahead_ms)], 0), *steady(1000, 50)])
    assert (done.stored, done.refused) == (1 + 150, 1)
    whole = store.append([told([reading("x_mm", 1.0, ahead_ms)], ahead_ms, lag_ms=-ahead_ms), *steady(10_000, 50)])
    assert (whole.stored, whole.refused) == (150, 1)
    assert store.status().newest_ms == T0_MS + 10_000 + 49 * 100
    with store._readers.snapshot() as db:
        assert db.execute("SELECT sum(samples) FROM chunks").fetchone() == (300,), "what follows goes the short way"
    store.close()
