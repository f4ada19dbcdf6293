"""The sealed part of a page of messages."""

from __future__ import annotations

import sqlite3
from collections import OrderedDict
from typing import NamedTuple

import numpy as np
import pyarrow.parquet as pq

from cnctwin.memory.store import hot
from cnctwin.memory.store.message_log import Header, Parts, Sealed
from cnctwin.memory.store.sealed.manifest import Checked, File
from cnctwin.memory.store.sealed.rows import HeaderOf, Ints, Part, read_rows
from cnctwin.memory.store.series_table import HISTORY_BIT, RANK_MASK, RANKS, REASON_SHIFT
from cnctwin.memory.store.value_form import PLAIN, Kind, given
from sparkplug.metric import Reading

FILES_KEPT = 4
_OF_PAGE = """
SELECT * FROM files WHERE machine = (SELECT id FROM machines WHERE name = ?) AND state = 0 AND class < 3
    AND first_number < ? AND last_number >= ?
"""


class SealedMessages:
    """The messages that one walk reads of the sealed hours; each file is read once where the walk goes on in time."""

    def __init__(self, checked: Checked) -> None:
        self._checked = checked
        self._read: OrderedDict[str, ByNumber] = OrderedDict()
        self._texts: dict[str | None, int] = {None: 0}

    def __call__(self, db: sqlite3.Connection, machine: str, first: int, until: int) -> Sealed:
        """Headers and samples of the messages [first, until)."""
        headers: dict[int, Header] = {}
        parts: Parts = {}
        wanted = [File(*row) for row in db.execute(_OF_PAGE, (machine, until, first))]
        if not wanted:
            return Sealed(headers, parts)
        series = hot.by_sid(db, machine)
        for file in self._checked.sound(wanted):
            rows = self._rows(db, file, machine)
            for number in range(*np.searchsorted(rows.numbers, (first, until)).tolist()):
                of = int(rows.numbers[number])
                header = rows.headers[of]
                if header.is_data:
                    headers[of] = Header(header.received_ms, header.node, header.stamp_ms, "", header.place)
                    parts.setdefault(of, [])
            for sid, part in rows.parts.items():
                start, end = np.searchsorted(part.numbers, (first, until)).tolist()
                if start < end:
                    self._readings(parts, sid, series[sid], part, slice(start, end))
        return Sealed(headers, parts)

    def _readings(self, parts: Parts, sid: int, series: tuple[str, str | None, Kind], part: Part, some: slice) -> None:
        """Put some samples of a series to their messages; those of births are of none."""
        name, unit, kind = series
        reasons = {number: text for text, number in self._texts.items()}
        flags = part.flags[some]
        marks = {
            flag: (RANKS[flag & RANK_MASK], unit, reasons[flag >> REASON_SHIFT], bool(flag & HISTORY_BIT))
            for flag in np.unique(flags).tolist()
        }
        t = part.t[some]
        forms = part.forms[some] if kind in PLAIN else [given(kind, form) for form in part.forms[some]]
        new, of = tuple.__new__, parts.get
        rows = zip(t.tolist(), (t // 1000).tolist(), forms, flags.tolist(), part.numbers[some].tolist(), strict=True)
        for t_us, t_ms, value, flag, number in rows:
            if (place := of(number)) is not None:
                place.append((t_us, sid, new(Reading, (name, value, t_ms, *marks[flag]))))

    def _rows(self, db: sqlite3.Connection, file: File, machine: str) -> ByNumber:
        if (rows := self._read.get(file.name)) is not None:
            self._read.move_to_end(file.name)
            return rows
        table = pq.read_table(self._checked.folder / file.name, partitioning=None)
        for text in table["reason"].unique().to_pylist():
            self._texts.setdefault(text, len(self._texts))
        kinds = {sid: kind for sid, (_, _, kind) in hot.by_sid(db, machine).items()}
        parts, headers = read_rows(table, kinds, self._texts)
        numbers = np.array(sorted(headers), dtype=np.int64)
        rows = self._read[file.name] = ByNumber({sid: _by_number(part) for sid, part in parts.items()}, headers, numbers)
        if len(self._read) > FILES_KEPT:
            self._read.popitem(last=False)
        return rows


class ByNumber(NamedTuple):
    """A file's samples, of each series in the order of their messages."""

    parts: dict[int, Part]
    headers: dict[int, HeaderOf]
    numbers: Ints


def _by_number(part: Part) -> Part:
    if not np.any(np.diff(part.numbers) < 0):
        return part
    order = np.argsort(part.numbers, kind="stable")
    forms = [part.forms[i] for i in order.tolist()]
    return Part(part.kind, part.t[order], forms, part.flags[order], part.numbers[order])
