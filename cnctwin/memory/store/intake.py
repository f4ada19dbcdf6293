"""A batch of messages becomes rows: each sample once, each message in the order in which it came.

A sample is told by machine, node, signal, millisecond, value, quality and reason. What is newer than all that is known of its
signal is new, which is nearly everything, and costs no question; it becomes columns (`chunk_writer`), and the rest rows. A live
reading that differs from the last one within the same millisecond is new too (A, B, A are three); history, and the readings of a
birth, which repeats what is known, are compared with all that is known of that millisecond.
"""

import sqlite3
from collections.abc import Callable, Sequence
from itertools import pairwise
from struct import pack
from typing import Any

from cnctwin.memory.store.birth_body import packed
from cnctwin.memory.store.chunk import CHUNK_MS, ChunkSamples, read_chunks
from cnctwin.memory.store.chunk_writer import STAMP_MS_MAX, ChunkWriter, stamp_ms_max
from cnctwin.memory.store.contract import Appended, Message
from cnctwin.memory.store.database import insert
from cnctwin.memory.store.series_table import (
    HISTORY_BIT,
    RANK,
    RANK_MASK,
    REASON_SHIFT,
    SeriesTable,
    Signal,
    Source,
    StoredClass,
    class_of,
)
from cnctwin.memory.store.value_form import CannotKeepError, Kind, given, kept, same
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.quality import Quality
from sparkplug.values import Value

WITHIN_MS_MAX = 999
HOUR_MS = 3_600_000
REPEATED, REFUSED = -1, -2
EVENT_CODES = {EventKind.BIRTH: 0, EventKind.DATA: 1, EventKind.DEATH: 2, EventKind.HOLE: 3}
EVENT_KINDS = {code: kind for kind, code in EVENT_CODES.items()}
_DATA = EventKind.DATA
DATA_CODE = EVENT_CODES[_DATA]
MINUTES_READ = 16
_EVENT = "INSERT INTO events VALUES"
_SAMPLE = "INSERT INTO samples VALUES"
_STALE = RANK[Quality.STALE]
Known = tuple[int, Kind, Any, int]
"""Time in µs, kind, value as SQLite has it, flag."""
Sealed = Callable[[Signal, StoredClass, int], Sequence[Known] | None]
"""The sealed hours' readings of a signal within a millisecond; None: they were swept, and take no more."""


class Batch:
    """One batch within one transaction.

    number: that of the last message there is; sealed: what the sealed hours hold; rows: samples that were written
    """

    def __init__(self, db: sqlite3.Connection, table: SeriesTable, number: int, sealed: Sealed) -> None:
        self._db, self._table, self.number, self._sealed = db, table, number, sealed
        self._rows: list[tuple[int, int, Any, int, int]] = []
        self._events: list[tuple[Any, ...]] = []
        self._chunks = ChunkWriter(db, table)
        self._changed = self._chunks.changed
        self._read: dict[tuple[int, int], ChunkSamples] = {}
        self.stored = self.repeated = self.refused = self.rows = 0

    def take(self, messages: Sequence[Message]) -> Appended:
        """All of them."""
        for received_ms, event in messages:
            self._message(received_ms, event)
        self._chunks.write_all()
        self._flush()
        insert(self._db, _EVENT, self._events)
        self._table.keep_latest(self._changed)
        self._db.execute("UPDATE meta SET value = ? WHERE name = 'number'", (self.number,))
        samples = self.rows + self._chunks.stored
        self._db.execute("UPDATE meta SET value = value + ? WHERE name = 'samples'", (samples,))
        return Appended(self.stored + self._chunks.stored, self.repeated, self.refused)

    def _flush(self) -> None:
        if self._rows:
            insert(self._db, _SAMPLE, self._rows)
            self.rows += len(self._rows)
            self._rows.clear()

    def _message(self, received_ms: int, event: HostEvent) -> None:
        kind, node_id, device, stamp_ms, readings = event[:5]
        is_data = kind is _DATA
        code = DATA_CODE if is_data else EVENT_CODES.get(kind)
        if code is None or (device is None and kind is not EventKind.HOLE):
            return
        latest_ms = stamp_ms_max(received_ms)
        if not -STAMP_MS_MAX <= stamp_ms <= latest_ms:
            self.refused += len(readings)
            return
        self.number += 1
        body, order = None, None
        places: list[tuple[int, int]] = []
        if device is None:
            machine, node = None, self._table.node(str(node_id))
        else:
            source = self._table.source(node_id, device)
            machine, node = source.machine, source.node
            if is_data and readings and not event.detail and self._chunks.take(source, self.number, received_ms, event):
                return
            places = self._readings(source, event, latest_ms)
            if not is_data:
                body = packed(readings)
            elif places:
                order = order_of(places)
            elif readings:
                self.number -= 1  # nothing of it is new
                return
        from_ms, to_ms = (min(places)[0] // 1000, max(places)[0] // 1000) if places else (None, None)
        self._events.append(
            (self.number, received_ms, machine, node, code, stamp_ms, event.detail or None, body, order, from_ms, to_ms)
        )

    def _readings(self, source: Source, event: HostEvent, latest_ms: int) -> list[tuple[int, int]]:
        """Take the readings of a message that are no later than `latest_ms`; time and series of those stored, in their order."""
        self._chunks.settle(source)
        table, known = self._table, source.signals
        reasons, places = table.reasons, list[tuple[int, int]]()
        is_birth, is_data = event.kind is EventKind.BIRTH, event.kind is EventKind.DATA
        for reading in event.readings:
            name, value, stamp_ms, quality, unit, reason, is_historical = reading
            try:
                kind, form = kept(value)
                if not 0 <= stamp_ms <= latest_ms:
                    raise CannotKeepError("a stamp that is none, or far ahead")
                signal = known.get(name) or table.signal(source, name)
                sid = signal.sids.get((unit, kind)) or table.series(signal, unit, kind)
                flag = RANK[quality] + HISTORY_BIT * is_historical
                if reason is not None:
                    flag += (reasons.get(reason) or table.reason(reason)) << REASON_SHIFT
            except (CannotKeepError, UnicodeEncodeError):
                self.refused += 1
                continue
            if stamp_ms > signal.last_ms:
                self._add(places, source, signal, (sid, stamp_ms * 1000, form, flag, self.number), value)
                self.stored += 1
                continue
            revives = is_birth and stamp_ms < signal.last_ms and signal.last_flag & RANK_MASK == _STALE
            t = self._late(
                (source, signal),
                value,
                kind,
                stamp_ms,
                flag,
                is_next=is_data and stamp_ms == signal.last_ms and not is_historical,
            )
            if t >= 0:
                self._add(places, source, signal, (sid, t, form, flag, self.number), value)
            if revives and event.timestamp_ms >= signal.last_ms:
                # The birth says that what went stale holds again: it is told once more, as of the birth.
                t = max(event.timestamp_ms * 1000, signal.last_us + 1)
                self._add(places, source, signal, (sid, t, form, flag, self.number), value)
            self.stored += t >= 0
            self.repeated += t == REPEATED
            self.refused += t == REFUSED
        return places

    def _add(
        self, places: list[tuple[int, int]], source: Source, signal: Signal, row: tuple[int, int, Any, int, int], value: Value
    ) -> None:
        sid, t, _, flag, _ = row
        self._rows.append(row)
        places.append((t, sid))
        if t > signal.last_us:
            signal.last_us, signal.last_ms = t, t // 1000
            signal.last, signal.last_sid, signal.last_flag = value, sid, flag
            source.newest_ms = max(source.newest_ms, signal.last_ms)
            self._changed[signal] = None
        if t < signal.first_us or signal.first_us < 0:
            signal.first_us = t
            self._changed[signal] = None

    def _late(self, place: tuple[Source, Signal], value: Value, kind: Kind, stamp_ms: int, flag: int, *, is_next: bool) -> int:
        """The time of a sample that is not newer than all others, REPEATED or REFUSED."""
        source, signal = place
        if stamp_ms == signal.last_ms and same(value, signal.last) and not (flag ^ signal.last_flag) & ~HISTORY_BIT:
            return REPEATED
        if is_next:
            return signal.last_us + 1 if signal.last_us % 1000 < WITHIN_MS_MAX else REFUSED
        self._flush()
        found = self._stored(source, signal, stamp_ms)
        if found is None:
            return REFUSED
        for _, of_kind, form, of_flag in found:
            if of_kind is kind and not (flag ^ of_flag) & ~HISTORY_BIT and same(value, given(kind, form)):
                return REPEATED
        t = max((t for t, *_ in found), default=stamp_ms * 1000 - 1) + 1
        return t if t // 1000 == stamp_ms else REFUSED

    def _stored(self, source: Source, signal: Signal, stamp_ms: int) -> list[Known] | None:
        """Return the stored readings of a signal within a millisecond; None where it was swept."""
        found: list[Known] = []
        chunks = self._chunks_of(source, stamp_ms)
        for (_, kind), sid in signal.sids.items():
            of_chunks = chunks.within(sid, stamp_ms * 1000, stamp_ms * 1000 + WITHIN_MS_MAX + 1)
            found += [(t, kind, value, flag) for t, value, flag in of_chunks]
            asked = "SELECT t, value, flag FROM samples WHERE sid = ? AND t BETWEEN ? AND ?"
            rows = self._db.execute(asked, (sid, stamp_ms * 1000, stamp_ms * 1000 + WITHIN_MS_MAX))
            found += [(t, kind, value, flag) for t, value, flag in rows]
        for stored_class in {class_of(signal.name, kind) for _, kind in signal.sids}:
            sealed = self._sealed(signal, stored_class, stamp_ms)
            if sealed is None:
                return None
            found += sealed
        return found

    def _chunks_of(self, source: Source, stamp_ms: int) -> ChunkSamples:
        """The chunks of a minute; an outage is filled minute by minute."""
        key = source.machine, stamp_ms // CHUNK_MS
        if self._chunks.write(source, key[1]) or len(self._read) >= MINUTES_READ:
            self._read.clear()
        if key not in self._read:
            from_ms = key[1] * CHUNK_MS
            self._read[key] = ChunkSamples(read_chunks(self._db, source.machine, from_ms, from_ms + CHUNK_MS))
        return self._read[key]


def order_of(places: Sequence[tuple[int, int]]) -> bytes | None:
    """Return the places of the readings in their message, in the order of time and series; None where that is the same."""
    if all(a <= b for a, b in pairwise(places)):
        return None
    return pack(f"<{len(places)}I", *sorted(range(len(places)), key=places.__getitem__))
