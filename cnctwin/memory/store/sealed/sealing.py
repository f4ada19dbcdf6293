"""Hours that nothing comes into any more leave SQLite for Parquet, in one transaction with the manifest.

An hour is due when it is over and nothing came into it for the margin, by the clock of arrival: a recording of years ago that is
replayed is not sealed while it plays. Hours with little in them wait for others of their day, so that a file is worth its footer.
What comes late for a sealed hour waits in SQLite, and is merged by writing that hour's file again.
"""

import json
import logging
import sqlite3
import zlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cnctwin.memory.store.chunk import CHUNK_MS, read_chunks
from cnctwin.memory.store.database import transaction
from cnctwin.memory.store.intake import DATA_CODE
from cnctwin.memory.store.sealed.chunk_columns import columns_of
from cnctwin.memory.store.sealed.manifest import DAY_MS, HOUR_MS, Checked, File, State, file_name, files, put
from cnctwin.memory.store.sealed.rows import HeaderOf, Made, Part, Rows, made, read_rows
from cnctwin.memory.store.series_table import SeriesTable, StoredClass
from cnctwin.memory.store.value_form import Kind

SAMPLES_MIN = 20_000
"""The samples that a file is worth; a quiet machine's hours wait for one another up to the end of the day."""
DAY_SAMPLES_MIN = 64
"""A day with fewer samples stays in SQLite: its file would be larger than they are, and one message could make hundreds."""
MINUTES = HOUR_MS // CHUNK_MS
AHEAD_MS = DAY_MS
"""An hour that is still to come (of a machine whose clock is ahead) is due when nothing came into it for so long."""
_log = logging.getLogger(__name__)


class Job(NamedTuple):
    """A stretch of whole hours of one machine within a day."""

    machine: int
    from_ms: int
    to_ms: int


class Done(NamedTuple):
    """The outcome of a job."""

    samples: int
    files: int
    left_over: tuple[str, ...]  # files that are not named any more


_HOURS = "SELECT t / 3600000000, count(*) FROM samples WHERE sid = ? GROUP BY 1"
_CHUNK_HOURS = f"""
SELECT minute / {MINUTES}, sum(samples), max(last_received_ms) FROM chunks INDEXED BY chunks_of_machine
WHERE machine = ? GROUP BY 1
"""  # noqa: S608
_ARRIVED = """
SELECT from_ms / 3600000, to_ms / 3600000, max(received_ms) FROM events
WHERE machine = ? AND to_ms >= ? AND from_ms IS NOT NULL GROUP BY 1, 2
"""
_HEADERS = """
SELECT number, received_ms, stamp_ms, nodes.name, kind, place FROM events JOIN nodes ON nodes.id = events.node
WHERE machine = ? AND number BETWEEN ? AND ? AND from_ms < ? AND to_ms >= ?
"""


class Sealer:
    """Knows what is due, and does it. margin_ms: how long nothing has to have come into an hour."""

    def __init__(self, db: sqlite3.Connection, file: Path, table: SeriesTable, checked: Checked, margin_ms: int) -> None:
        self._db, self._file, self._table, self._checked, self._margin_ms = db, file, table, checked, margin_ms
        self._not_before_ms: dict[int, int] = {}

    def due(self, now_ms: int) -> Iterable[Job]:
        """Yield the jobs that are due, machine by machine; nothing is looked at again before something can have changed."""
        for machine in list(self._table.machines.values()):
            if self._not_before_ms.get(machine, 0) <= now_ms:
                jobs, self._not_before_ms[machine] = self._due_of(machine, now_ms)
                yield from jobs

    def look_again(self, machine: int) -> None:
        """Not all that was due of a machine may have been done."""
        self._not_before_ms.pop(machine, None)

    def _due_of(self, machine: int, now_ms: int) -> tuple[list[Job], int]:
        horizon_ms = (now_ms - self._margin_ms) // HOUR_MS * HOUR_MS
        next_ms = horizon_ms + HOUR_MS + self._margin_ms
        counts: dict[int, int] = {}
        for (sid,) in self._db.execute(
            "SELECT sid FROM series JOIN signals ON signals.id = signal WHERE machine = ?", (machine,)
        ).fetchall():
            for hour, count in self._db.execute(_HOURS, (sid,)):
                counts[hour] = counts.get(hour, 0) + count
        arrived: dict[int, int] = {}
        for hour, count, received_ms in self._db.execute(_CHUNK_HOURS, (machine,)):
            counts[hour] = counts.get(hour, 0) + count
            arrived[hour] = received_ms
        if not counts:
            return [], next_ms
        for first, last, received_ms in self._db.execute(_ARRIVED, (machine, min(counts) * HOUR_MS)):
            # One message may reach over many hours only in history, which is rare and short.
            for hour in {first, last, *(h for h in counts if first < h < last)}:
                arrived[hour] = max(arrived.get(hour, 0), received_ms)
        quiet_from_ms = {
            hour: (came_ms if (came_ms := arrived.get(hour, 0)) <= now_ms + DAY_MS else 0)  # else our own clock was wrong
            + (self._margin_ms if hour * HOUR_MS < horizon_ms else AHEAD_MS)
            for hour in counts
        }
        ripe = {hour for hour in counts if quiet_from_ms[hour] <= now_ms}
        waiting = [quiet_from_ms[hour] for hour in counts if hour not in ripe]
        return self._jobs(machine, counts, ripe, horizon_ms), min([next_ms, *waiting])

    def _jobs(self, machine: int, counts: Mapping[int, int], ripe: set[int], horizon_ms: int) -> list[Job]:
        jobs: list[Job] = []
        for day in sorted({hour // 24 for hour in ripe}):
            from_ms, to_ms = day * DAY_MS, (day + 1) * DAY_MS
            there = {
                (f.from_ms, f.to_ms) for f in files(self._db, machine, from_ms, to_ms) if f.stored_class != StoredClass.ROLLUP
            }
            if not there and sum(count for hour, count in counts.items() if hour // 24 == day) < DAY_SAMPLES_MIN:
                continue
            is_over = all(hour in ripe for hour in counts if hour // 24 == day) and (
                to_ms <= horizon_ms or any(day * 24 <= hour < day * 24 + 24 and hour * HOUR_MS >= horizon_ms for hour in ripe)
            )
            run: list[int] = []
            for hour in range(day * 24, day * 24 + 24):
                span = next((s for s in there if s[0] <= hour * HOUR_MS < s[1]), None)
                if span is not None or (hour in counts and hour not in ripe):
                    self._close(jobs, machine, counts, run, is_over=is_over or span is not None)
                    if hour in ripe and span is not None and Job(machine, *span) not in jobs:
                        jobs.append(Job(machine, *span))
                elif hour in ripe:
                    run.append(hour)
                    if sum(counts[h] for h in run) >= SAMPLES_MIN:
                        self._close(jobs, machine, counts, run, is_over=True)
            self._close(jobs, machine, counts, run, is_over=is_over)
        return jobs

    def _close(self, jobs: list[Job], machine: int, counts: Mapping[int, int], run: list[int], *, is_over: bool) -> None:
        """End a run of hours: a file, or they wait on."""
        if run and (is_over or sum(counts[hour] for hour in run) >= SAMPLES_MIN):
            jobs.append(Job(machine, run[0] * HOUR_MS, (run[-1] + 1) * HOUR_MS))
        run.clear()

    def seal(self, job: Job) -> Done:
        """Move a stretch. Raises StoreError, and then nothing has changed."""
        kinds, classes, about = self._series(job.machine)
        done = Done(0, 0, ())
        with transaction(self._db, self._file):
            chunks = read_chunks(self._db, *job)
            for stored_class in (StoredClass.RAW, StoredClass.BLOCK, StoredClass.TWIN):
                of_chunks = columns_of(chunk for chunk in chunks if chunk.stored_class == stored_class)
                hot = ((sid, self._hot(sid, kinds[sid], job)) for sid in kinds if classes[sid] == stored_class)
                of_rows = {sid: part for sid, part in hot if part is not None}
                headers = of_chunks.headers | self._headers(job, of_rows, about) if of_rows else of_chunks.headers
                parts = _joined(of_chunks.parts, of_rows)
                if parts:
                    done = self._seal_class(job, stored_class, Rows(parts, headers), about, done)
            self._remove(job, list(kinds))
        return done

    def _seal_class(self, job: Job, stored_class: StoredClass, new: Rows, series: Mapping[int, Any], done: Done) -> Done:
        parts, headers = new
        names = {number: name for name, number in self._table.machines.items()}
        reasons: dict[int, str | None] = {number: text for text, number in self._table.reasons.items()}
        samples = done.samples + sum(len(part.t) for part in parts.values())
        left_over = done.left_over
        there = files(self._db, job.machine, job.from_ms, job.to_ms)
        for old in (f for f in there if f.stored_class == stored_class):
            if old.state == State.SWEPT:  # what came is past its time, too
                self._db.execute("UPDATE meta SET value = value - ? WHERE name = 'samples'", (samples - done.samples,))
                return Done(samples, done.files, left_over)
            if old.state == State.SEALED and (rows := self._read(old)) is not None:
                parts, headers = _joined(rows.parts, parts), rows.headers | headers
                left_over = (*left_over, old.name)
                self._db.execute("DELETE FROM files WHERE id = ?", (old.id,))
        about = {"class": int(stored_class), "machine": names[job.machine], "from_ms": job.from_ms, "to_ms": job.to_ms}
        made_of = about | {"series": {sid: series[sid] for sid in parts}}
        add_file(self._db, self._checked.folder, about, job.machine, made(parts, headers, reasons, made_of))
        return Done(samples, done.files + 1, left_over)

    def _series(self, machine: int) -> tuple[dict[int, Kind], dict[int, int], dict[int, list[Any]]]:
        kinds: dict[int, Kind] = {}
        classes: dict[int, int] = {}
        about: dict[int, list[Any]] = {}
        asked = """SELECT sid, unit, kind, class, signals.name, nodes.name FROM series JOIN signals ON signals.id = series.signal
            JOIN nodes ON nodes.id = signals.node WHERE machine = ? ORDER BY sid"""
        for sid, unit, kind, stored_class, signal, node in self._db.execute(asked, (machine,)):
            kinds[sid], classes[sid], about[sid] = Kind(kind), stored_class, [node, signal, unit, kind]
        return kinds, classes, about

    def _hot(self, sid: int, kind: Kind, job: Job) -> Part | None:
        asked = "SELECT t, value, flag, number FROM samples WHERE sid = ? AND t >= ? AND t < ?"
        rows = self._db.execute(asked, (sid, job.from_ms * 1000, job.to_ms * 1000)).fetchall()
        if not rows:
            return None
        t, forms, flags, numbers = zip(*rows, strict=True)
        return Part(kind, np.array(t, np.int64), list(forms), np.array(flags, np.int64), np.array(numbers, np.int64))

    def _headers(self, job: Job, parts: Mapping[int, Part], series: Mapping[int, Any]) -> dict[int, HeaderOf]:
        first = min(int(part.numbers.min()) for part in parts.values())
        last = max(int(part.numbers.max()) for part in parts.values())
        rows = self._db.execute(_HEADERS, (job.machine, first, last, job.to_ms, job.from_ms))
        found = {
            number: HeaderOf(received_ms, stamp_ms, node, kind == DATA_CODE, place)
            for number, received_ms, stamp_ms, node, kind, place in rows
        }
        for sid, part in parts.items():  # of a birth that was swept before its samples were sealed these are all that is left
            for number in set(part.numbers.tolist()) - found.keys():
                t_ms = int(part.t[part.numbers == number][0]) // 1000
                found[number] = HeaderOf(t_ms, t_ms, series[sid][0], is_data=False, place=None)
        return found

    def _read(self, file: File) -> Rows | None:
        """Return what a file holds; one that is damaged is set aside, and what is new begins another."""
        try:
            if self._checked.sound([file]):
                table = pq.read_table(self._checked.folder / file.name, partitioning=None)
                return read_rows(table, self._table.kinds, self._table.reasons)
            trouble = self._checked.damaged[file.name]
        except (OSError, pa.ArrowException) as error:
            trouble = f"{self._checked.folder / file.name}: cannot be read: {str(error).splitlines()[0]}"
        _log.warning("%s; it is set aside, and the rest goes on", trouble)
        set_aside(self._db, self._checked.folder, file)
        return None

    def _remove(self, job: Job, sids: Iterable[int]) -> None:
        """The samples go, and the messages of which nothing is left here."""
        span = (job.from_ms * 1000, job.to_ms * 1000)
        self._db.executemany("DELETE FROM samples WHERE sid = ? AND t >= ? AND t < ?", [(sid, *span) for sid in sids])
        inside = f"DELETE FROM events WHERE machine = ? AND kind = {DATA_CODE} AND from_ms >= ? AND to_ms < ?"  # noqa: S608
        self._db.execute(inside, job)
        minutes = (job.machine, job.from_ms // CHUNK_MS, job.to_ms // CHUNK_MS)
        self._db.execute("DELETE FROM chunks WHERE machine = ? AND minute >= ? AND minute < ?", minutes)
        across = f"""SELECT number, from_ms, to_ms FROM events
            WHERE machine = ? AND kind = {DATA_CODE} AND from_ms < ? AND to_ms >= ?"""  # noqa: S608
        for number, from_ms, to_ms in self._db.execute(across, (job.machine, job.to_ms, job.from_ms)).fetchall():
            left = "SELECT 1 FROM samples WHERE sid = ? AND t >= ? AND t < ? AND number = ? LIMIT 1"
            values = (from_ms * 1000, to_ms * 1000 + 1000, number)
            if not any(self._db.execute(left, (sid, *values)).fetchone() for sid in sids):
                self._db.execute("DELETE FROM events WHERE number = ?", (number,))


def add_file(db: sqlite3.Connection, folder: Path, about: Mapping[str, Any], machine: int, done: Made) -> None:
    """Write a file and name it in the manifest, within a transaction; `about` is what it says of itself."""
    stored_class, from_ms, to_ms = StoredClass(about["class"]), about["from_ms"], about["to_ms"]
    found = db.execute("SELECT seq FROM sqlite_sequence WHERE name = 'files'").fetchone()
    number = 1 if found is None else int(found[0]) + 1
    name = file_name(stored_class, about["machine"], from_ms, to_ms, number)
    put(folder, name, done.body)
    columns = json.dumps({"endings": done.endings, "nulls": done.nulls, "odd": done.is_odd})
    db.execute(
        "INSERT INTO files VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        (number, int(stored_class), machine, from_ms, to_ms, name, int(State.SEALED), len(done.body), zlib.crc32(done.body),
         done.samples, done.first_number, done.last_number, done.first_received_ms, done.last_received_ms, columns),
    )  # fmt: skip


def set_aside(db: sqlite3.Connection, folder: Path, file: File) -> None:
    """A damaged file goes out of the way, under a name that says so; the manifest remembers it."""
    with suppress(OSError):
        (folder / file.name).replace(folder / (file.name + ".damaged"))
    db.execute(
        "UPDATE files SET state = ?, bytes = 0, samples = 0, name = ? WHERE id = ?",
        (State.DAMAGED, file.name + ".damaged", file.id),
    )
    db.execute("UPDATE meta SET value = value - ? WHERE name = 'samples'", (file.samples,))


def _joined(before: Mapping[int, Part], new: Mapping[int, Part]) -> dict[int, Part]:
    joined = dict(before)
    for sid, part in new.items():
        old = joined.get(sid)
        if old is None:
            joined[sid] = part
        else:
            joined[sid] = Part(
                part.kind,
                np.concatenate([old.t, part.t]),
                [*old.forms, *part.forms],
                np.concatenate([old.flags, part.flags]),
                np.concatenate([old.numbers, part.numbers]),
            )
    return joined
