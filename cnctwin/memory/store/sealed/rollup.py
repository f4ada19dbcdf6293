"""Roll-ups: of each minute, signal by signal, count, mean, low, high and last, one file a machine and day, kept for ever.

They are made of the sealed hours when a day is over, and answer windows of whole minutes where the raw samples are gone. They are
for looking at; nothing is trained on them or replayed from them.
"""

import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from cnctwin.memory.store.hot import SeriesOf
from cnctwin.memory.store.sealed.answers import SealedAnswers
from cnctwin.memory.store.sealed.manifest import DAY_MS, Checked, File, State, files
from cnctwin.memory.store.sealed.rows import Made, parquet
from cnctwin.memory.store.sealed.sealing import Job, add_file
from cnctwin.memory.store.series_table import StoredClass
from cnctwin.memory.store.value_form import BLOCKS, Kind, given, kept
from cnctwin.memory.store.windows import Numbers, Window, Windows

MINUTE_MS = 60_000
_SPLIT = ("mean", "low", "high", "last")
_DELTA = ("sid", "minute", "samples", "good")
_CODES = ("kind", "worst")
_TEXTS = ("text", "reason")
_COLUMNS = (*_DELTA, *_SPLIT, *_CODES, *_TEXTS)


class Span(NamedTuple):
    """A stretch of time, ms."""

    from_ms: int
    to_ms: int


class Minute(NamedTuple):
    """A row of a roll-up; kind, last or text: of the last sample."""

    sid: int
    minute: int
    samples: int
    good: int
    mean: float | None
    low: float | None
    high: float | None
    last: float | None
    kind: int
    worst: int
    text: str | None
    reason: str | None

    def into(self, window: Window) -> None:
        """Add it to a window."""
        at_us = self.minute * MINUTE_MS * 1000
        kind = Kind(self.kind)
        is_number = kind in (Kind.FLOAT, Kind.INT)
        value = given(kind, self.text if self.text is not None else self.last) if kind is not Kind.NULL else None
        if self.good:
            total = (self.mean or 0.0) * self.good
            window.add_numbers(Numbers(self.samples, self.good, total, self.low, self.high, at_us, value))
        else:
            window.count += self.samples
            if at_us > window.last_us:
                window.last_us, window.last, window.is_number = at_us, value, is_number
        if self.worst:
            window.mark(self.worst, at_us, self.reason)


def minute_of(sid: int, minute: int, window: Window) -> Minute:
    """Return what is kept of a window of a minute."""
    kind, form = kept(window.last)
    text = form if isinstance(form, str) else None
    last = None if text is not None or form is None or isinstance(form, bytes) else float(form)
    mean = window.total / window.good if window.good else None
    low, high = (window.low, window.high) if window.good else (None, None)
    return Minute(
        sid, minute, window.count, window.good, mean, low, high, last, int(kind), window.worst, text, window.reason
    )  # fmt: skip


def gone(there: Iterable[File]) -> list[Span]:
    """The stretches whose raw samples were swept, or set aside."""
    return [Span(f.from_ms, f.to_ms) for f in there if f.stored_class == StoredClass.RAW and f.state != State.SEALED]


def fill_gone(
    checked: Checked, windows: Mapping[int, Windows], series: Iterable[SeriesOf], there: Sequence[File], asked: Span
) -> None:
    """Put the minutes of stretches that are gone into windows that are whole minutes, of those series that are raw."""
    raw = {s.sid for s in series if s.stored_class == StoredClass.RAW}
    lost = gone(there)
    rolled = [f for f in there if f.stored_class == StoredClass.ROLLUP and f.state == State.SEALED]
    for row in _read(checked, rolled) if lost and raw else ():
        at_ms = row.minute * MINUTE_MS
        if row.sid in raw and asked.from_ms <= at_ms < asked.to_ms and any(a <= at_ms < b for a, b in lost):
            row.into(windows[row.sid].at(at_ms * 1000 // windows[row.sid].every_us))


def _read(checked: Checked, rolled: Iterable[File]) -> Iterator[Minute]:
    for file in checked.sound(rolled):
        table = pq.read_table(checked.folder / file.name, partitioning=None, columns=list(_COLUMNS))
        yield from map(Minute._make, zip(*(table[name].to_pylist() for name in Minute._fields), strict=True))


def roll_up(db: sqlite3.Connection, answers: SealedAnswers, checked: Checked, machine: tuple[int, str], day: int) -> list[str]:
    """Write the roll-up of a day again, within a transaction; names of files that are not needed any more."""
    number, name = machine
    job = Job(number, day * DAY_MS, (day + 1) * DAY_MS)
    there = files(db, number, job.from_ms, job.to_ms)
    series = _series(db, number)
    windows = {s.sid: Windows(MINUTE_MS) for s in series}
    sealed = [f for f in there if f.state == State.SEALED and f.stored_class in (StoredClass.RAW, StoredClass.TWIN)]
    answers.fill(checked.sound(sealed), windows, series, job.from_ms, job.to_ms, with_last=True)
    fill_gone(checked, windows, series, there, Span(job.from_ms, job.to_ms))
    rows = [minute_of(sid, minute, window) for sid in sorted(windows) for minute, window in windows[sid].rows()]
    old = [f for f in there if f.stored_class == StoredClass.ROLLUP]
    db.executemany("DELETE FROM files WHERE id = ?", [(f.id,) for f in old])
    if rows:
        about = {"class": int(StoredClass.ROLLUP), "machine": name, "from_ms": job.from_ms, "to_ms": job.to_ms, "series": {}}
        add_file(db, checked.folder, about, number, Made(_body(rows, about), 0, {}, [], False, 0, 0, 0, 0))
    return [f.name for f in old]


def _series(db: sqlite3.Connection, machine: int) -> list[SeriesOf]:
    asked = "SELECT sid, unit, kind, class FROM series JOIN signals ON signals.id = signal WHERE machine = ?"
    every = [SeriesOf(sid, unit, Kind(kind), of) for sid, unit, kind, of in db.execute(asked, (machine,))]
    return [s for s in every if s.kind not in BLOCKS]


def _body(rows: Sequence[Minute], about: Mapping[str, Any]) -> bytes:
    columns = dict(zip(Minute._fields, zip(*rows, strict=True), strict=True))
    types = (
        dict.fromkeys(_DELTA, pa.int64()) | dict.fromkeys(_SPLIT, pa.float64()) | dict.fromkeys(_CODES, pa.int8())
        | dict.fromkeys(_TEXTS, pa.string())
    )  # fmt: skip
    table = pa.table({name: pa.array(columns[name], types[name]) for name in _COLUMNS})
    encodings = dict.fromkeys(_DELTA, "DELTA_BINARY_PACKED") | dict.fromkeys(_SPLIT, "BYTE_STREAM_SPLIT")
    return parquet(table, about, use_dictionary=list(_TEXTS), column_encoding=encodings)
