"""The sealed hours' readings of a signal within a millisecond: asked of each sample that comes late for one of them."""

import logging
import sqlite3
from collections import OrderedDict
from collections.abc import Mapping, Sequence

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cnctwin.memory.store.intake import WITHIN_MS_MAX, Known
from cnctwin.memory.store.sealed.manifest import HOUR_MS, Checked, File, State, files
from cnctwin.memory.store.sealed.rows import Part, read_rows
from cnctwin.memory.store.series_table import SeriesTable, Signal, StoredClass

HOURS_KEPT = 4
_log = logging.getLogger(__name__)
_Hour = Mapping[int, Part] | None


class LateHistory:
    """Keeps the last few hours that were asked for, since an outage is filled hour by hour. `forget` after sealing."""

    def __init__(self, db: sqlite3.Connection, table: SeriesTable, checked: Checked) -> None:
        self._db, self._table, self._checked = db, table, checked
        self._hours: OrderedDict[tuple[int, int, int], _Hour] = OrderedDict()

    def forget(self) -> None:
        """Files have changed."""
        self._hours.clear()

    def __call__(self, signal: Signal, stored_class: StoredClass, stamp_ms: int) -> Sequence[Known] | None:
        """Samples of the signal in that millisecond; None where its hour was swept."""
        parts = self._hour(signal.machine, stored_class, stamp_ms // HOUR_MS)
        if parts is None:
            return None
        found: list[Known] = []
        for sid in signal.sids.values():
            part = parts.get(sid)
            if part is not None:
                first, end = np.searchsorted(part.t, (stamp_ms * 1000, stamp_ms * 1000 + WITHIN_MS_MAX + 1))
                found += [(int(part.t[i]), part.kind, part.forms[i], int(part.flags[i])) for i in range(first, end)]
        return found

    def _hour(self, machine: int, stored_class: StoredClass, hour: int) -> _Hour:
        key = (machine, int(stored_class), hour)
        if key in self._hours:
            self._hours.move_to_end(key)
            return self._hours[key]
        there = [f for f in files(self._db, machine, hour * HOUR_MS, (hour + 1) * HOUR_MS) if f.stored_class == stored_class]
        parts: _Hour = {}
        if any(file.state == State.SWEPT for file in there):
            parts = None
        elif sealed := [file for file in there if file.state == State.SEALED]:
            parts = self._read(sealed[0])
        self._hours[key] = parts
        if len(self._hours) > HOURS_KEPT:
            self._hours.popitem(last=False)
        return parts

    def _read(self, file: File) -> Mapping[int, Part]:
        try:
            if not self._checked.sound([file]):
                return {}
            table = pq.read_table(self._checked.folder / file.name, partitioning=None)
        except (OSError, pa.ArrowException) as error:  # nobody can tell any more what was there already
            _log.warning("%s: %s; what comes late for it is kept", self._checked.folder / file.name, str(error).splitlines()[0])
            return {}
        return read_rows(table, self._table.kinds, self._table.reasons).parts
