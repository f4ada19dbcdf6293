"""A day of one machine in the store: ten quantised signals at 10 Hz, 8.6 million samples, beside bare SQLite and bare DuckDB.

    python -m benchmarks.store.embedded              # some minutes
    python -m benchmarks.store.embedded --quick      # three hours of a machine

What is measured, in one run: samples appended a second (SQLite `executemany` of the same rows beside it), bytes a sample, what
sealing an hour takes, the last five minutes at 1 s and a day at 1 min (mean, low, high) of three signals, the last of every
signal, messages again, and memory. Times are processor time of all threads, the median of several, so that a machine with other
work says nearly the same; those of the sheet are wall time.
"""

import argparse
import contextlib
import json
import resource
import shutil
import sqlite3
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import duckdb
import numpy as np

from cnctwin.memory.store.contract import Message, Query
from cnctwin.memory.store.embedded import EmbeddedStore
from cnctwin.memory.store.sealed.manifest import DAY_MS, HOUR_MS
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality

T0_MS = 1_790_000_000_000 // DAY_MS * DAY_MS
NODE, BATCH, HZ = NodeId("cnc", "edge-vmc"), 100, 10
SIGNALS = (
    ("axis_x_pos_mm", "mm", 3), ("axis_y_pos_mm", "mm", 3), ("axis_z_pos_mm", "mm", 3), ("spindle_rpm", "rev/min", 0),
    ("spindle_load_pct", "%", 1), ("feed_mm_min", "mm/min", 0), ("axis_x_load_pct", "%", 0), ("axis_y_load_pct", "%", 0),
    ("spindle_temp_c", "°C", 1), ("vibration_rms_g", "g", 3),
)  # fmt: skip
THREE = ("axis_x_pos_mm", "spindle_load_pct", "spindle_temp_c")
SHEET = {"five_minutes_hot_ms": 2.1, "five_minutes_sealed_ms": 4.4, "day_sealed_ms": 16.0, "bytes_a_sample": 1.23}


def hour_of(hour: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(n, signals): contouring with noise of the last digit, as controls report it; a minute in ten the machine stands."""
    n = 3600 * HZ
    t = (np.arange(n) + hour * n) / HZ
    chance = np.random.default_rng(hour)
    runs = (t % 600 < 540).astype(float)
    path = np.cumsum(runs) / HZ
    columns = [
        200 * np.sin(path / 11), 150 * np.sin(path / 7 + 1), -30 - 10 * np.sin(path / 29),
        runs * 8000 + runs * chance.normal(0, 2, n), runs * (30 + 10 * np.sin(t / 5)) + chance.normal(0, 0.3, n),
        runs * (2500 + 100 * np.sin(t)), runs * (20 + 8 * np.sin(path / 11)), runs * (18 + 8 * np.sin(path / 7)),
        30 + 5 * np.sin(t / 4000) + chance.normal(0, 0.05, n), 0.05 + runs * np.abs(chance.normal(0.3, 0.05, n)),
    ]  # fmt: skip
    return np.column_stack([np.round(c, d) for c, (_, _, d) in zip(columns, SIGNALS, strict=True)])


def messages_of(hour: int) -> Iterator[list[Message]]:
    """An hour in batches, stamped with a few milliseconds of jitter, received with a few more."""
    values, chance = hour_of(hour).tolist(), np.random.default_rng(1000 + hour)
    jitter, lag = chance.integers(0, 4, len(values)).tolist(), chance.integers(5, 25, len(values)).tolist()
    good, kind, start = Quality.GOOD, EventKind.DATA, T0_MS + hour * HOUR_MS
    for at in range(0, len(values), BATCH):
        batch = []
        for n in range(at, at + BATCH):
            t = start + n * (1000 // HZ) + jitter[n]
            row = values[n]
            readings = tuple(Reading(s[0], v, t, good, s[1], None, False) for s, v in zip(SIGNALS, row, strict=True))
            batch.append(Message(t + lag[n], HostEvent(kind, NODE, "vmc", t, readings)))
        yield batch


def bare_sqlite(folder: Path, batches: list[list[Message]]) -> float:
    """Seconds that the same rows take with nothing but `executemany`, a transaction a batch."""
    db = sqlite3.connect(folder / "bare.sqlite", isolation_level=None)
    db.executescript(
        """PRAGMA journal_mode = WAL; PRAGMA synchronous = NORMAL;
        CREATE TABLE s(sid INTEGER, t INTEGER, value REAL, PRIMARY KEY(sid, t)) WITHOUT ROWID;"""
    )
    began = time.process_time()
    for batch in batches:
        rows = [(sid, r.timestamp_ms * 1000, r.value) for m in batch for sid, r in enumerate(m.event.readings)]
        db.execute("BEGIN")
        db.executemany("INSERT INTO s VALUES (?, ?, ?)", rows)
        db.execute("COMMIT")
    took = time.process_time() - began
    db.close()
    return took


def bare_answers(folder: Path, store_folder: Path, to_ms: int) -> dict[str, float]:
    """The questions of the sheet with nothing around them: SQLite's rows, and DuckDB over the store's own files."""
    db = sqlite3.connect(folder / "bare.sqlite")
    five = "SELECT t / 1000000, avg(value), min(value), max(value) FROM s WHERE sid = ? AND t >= ? AND t < ? GROUP BY 1"
    span = ((to_ms - 300_000) * 1000, to_ms * 1000)
    hot = median_ms(lambda: [db.execute(five, (sid, *span)).fetchall() for sid in (0, 4, 8)])
    db.close()
    duck = duckdb.connect(":memory:", config={"threads": 2})
    duck.execute("SET parquet_metadata_cache = true")
    files = [str(path) for path in sorted(store_folder.glob("cnc_raw/*/*/*.parquet"))]
    names = [row[0] for row in duck.execute("DESCRIBE SELECT * FROM read_parquet(?, union_by_name = true)", [files]).fetchall()]
    three = [f"avg({n}), min({n}), max({n})" for sid in (1, 5, 9) for n in names if n.startswith(f"s{sid}e")]
    text = f"SELECT t // 60000 AS w, {', '.join(three)} FROM read_parquet(?, union_by_name = true) GROUP BY w"
    day = median_ms(lambda: duck.execute(text, [files]).fetchall())
    last = to_ms - 2 * HOUR_MS
    within = (
        f"SELECT t // 1000 AS w, {', '.join(three)} FROM read_parquet(?) WHERE t >= {last - 300_000} AND t < {last} GROUP BY w"
    )
    sealed = median_ms(lambda: duck.execute(within, [files[-2:-1]]).fetchall())
    duck.close()
    return {"five_minutes_hot_ms": hot, "five_minutes_sealed_ms": sealed, "day_sealed_ms": day}


def median_ms(ask: Callable[[], Any], times: int = 15) -> float:
    """Processor time of all threads, the first one left out."""
    ask()
    took = []
    for _ in range(times):
        began = time.process_time()
        ask()
        took.append(1000 * (time.process_time() - began))
    return round(statistics.median(took), 2)


def measured(folder: Path, hours: int) -> dict[str, Any]:
    """All of it, of so many hours, of which the last is not sealed."""
    place = folder / "store"
    store = EmbeddedStore(place, writable=True)
    appended = sealing = 0.0
    samples, sealed = 0, 0
    last: list[list[Message]] = []
    slowest = 0.0
    for hour in range(hours):
        last = list(messages_of(hour))
        for batch in last:
            began, wall = time.process_time(), time.perf_counter()
            done = store.append(batch)
            appended += time.process_time() - began
            slowest = max(slowest, time.perf_counter() - wall)
            samples += done.stored
        if hour:
            began = time.process_time()
            sealed += store.tidy(T0_MS + hour * HOUR_MS + 900_000).sealed
            sealing += time.process_time() - began
    assert samples == hours * 3600 * HZ * len(SIGNALS)
    bare_s = bare_sqlite(folder, last)
    to_ms = T0_MS + hours * HOUR_MS
    files = sum(path.stat().st_size for path in place.rglob("*.parquet"))
    of_hour = lambda every: Query("vmc", THREE, to_ms - 300_000, to_ms, every)  # noqa: E731
    told: dict[str, Any] = {
        "samples": samples,
        "append_samples_a_second": round(samples / appended),
        "bare_sqlite_samples_a_second": round(len(last) * BATCH * len(SIGNALS) / bare_s),
        "append_slowest_batch_ms": round(1000 * slowest, 1),
        "seal_hour_s": round(sealing / max(sealed, 1), 2),
        "bytes_a_sample": round(files / (samples * (hours - 1) / hours), 3),
        "five_minutes_hot_ms": median_ms(lambda: store.query(of_hour(1000))),
        "five_minutes_sealed_ms": median_ms(
            lambda: store.query(Query("vmc", THREE, to_ms - 2 * HOUR_MS - 300_000, to_ms - 2 * HOUR_MS, 1000))
        ),
        "day_sealed_ms": median_ms(lambda: store.query(Query("vmc", THREE, T0_MS, to_ms - HOUR_MS, 60_000))),
        "hour_raw_ms": median_ms(lambda: store.query(Query("vmc", THREE, T0_MS, T0_MS + HOUR_MS)), 3),
        "latest_ms": median_ms(lambda: store.latest("vmc")),
    }
    began = time.process_time()
    count = sum(1 for _ in store.messages("vmc", T0_MS, T0_MS + HOUR_MS))
    told["messages_a_second"] = round(count / (time.process_time() - began))
    told["bare"] = bare_answers(folder, place, to_ms)
    told["memory_mb"] = round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    told["status_ms"] = median_ms(store.status)
    store.close()
    return told


def main() -> int:
    """Measure, and print beside the figures of the sheet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three hours instead of twenty-five")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="store-benchmark-"))
    with contextlib.ExitStack() as stack:
        stack.callback(shutil.rmtree, folder)
        told = measured(folder, 3 if options.quick else 25)
    if options.json:
        sys.stdout.write(json.dumps(told) + "\n")
        return 0
    for name, value in told.items():
        if name == "bare":
            continue
        beside = [f"bare {told['bare'][name]}, ratio {value / told['bare'][name]:.1f}"] if name in told["bare"] else []
        beside += [f"sheet {SHEET[name]}"] if name in SHEET else []
        sys.stdout.write(f"{name:34} {value:>12} {'  (' + '; '.join(beside) + ')' if beside else ''}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
