"""Sealed files that the manifest does not name: which of them say nothing that is not here anyhow, and may go.

A kill leaves two kinds: a file that was written, and its transaction not; and one that another has taken the place of. In a
folder whose database is an older copy, or was begun again by a program that could not read sealed hours, there are others, and
those are all that is left of their hours.
"""

import json
import sqlite3
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from cnctwin.memory.store.chunk import CHUNK_MS
from cnctwin.memory.store.sealed.manifest import State
from cnctwin.memory.store.sealed.rows import METADATA
from cnctwin.memory.store.series_table import StoredClass

_HOT = """
SELECT count(*) FROM machines JOIN signals ON signals.machine = machines.id JOIN series ON series.signal = signals.id
    JOIN samples ON samples.sid = series.sid
WHERE machines.name = ? AND samples.t >= ? AND samples.t < ? AND series.class = ?
"""
_CHUNKS = """
SELECT coalesce(sum(samples), 0) FROM machines JOIN chunks INDEXED BY chunks_of_machine ON machine = machines.id
WHERE machines.name = ? AND minute >= ? AND minute < ? AND class = ?
"""
_NAMED = f"""
SELECT coalesce(sum(samples), 0), coalesce(max(files.id), 0) FROM files JOIN machines ON machines.id = files.machine
WHERE machines.name = ? AND from_ms < ? AND to_ms > ? AND class = ? AND state != {int(State.DAMAGED)}
"""  # noqa: S608


class LeftOver:
    """Asks one database about files of its folder."""

    def __init__(self, db: sqlite3.Connection, folder: Path) -> None:
        self._db, self._folder = db, folder

    def is_here(self, name: str) -> bool:
        """Return True if all that a file holds is in the database or in files that it names."""
        if name.endswith(".part") or self._db.execute("SELECT 1 FROM files WHERE name = ?", (name,)).fetchone():
            return True
        try:
            found = pq.read_metadata(self._folder / name)
            about, number = json.loads(found.metadata[METADATA]), int(Path(name).name.split(".")[1])
            machine, stored_class, from_ms, to_ms = (about[key] for key in ("machine", "class", "from_ms", "to_ms"))
        except (OSError, pa.ArrowException, KeyError, TypeError, ValueError, IndexError):
            return False
        if stored_class == StoredClass.ROLLUP:  # is made again of the hours
            return any(self._named(machine, from_ms, to_ms, of)[1] for of in (StoredClass.RAW, StoredClass.TWIN))
        samples, newest = self._named(machine, from_ms, to_ms, stored_class)
        if number < newest:
            return True
        (hot,) = self._db.execute(_HOT, (machine, from_ms * 1000, to_ms * 1000, stored_class)).fetchone()
        (chunks,) = self._db.execute(_CHUNKS, (machine, from_ms // CHUNK_MS, to_ms // CHUNK_MS, stored_class)).fetchone()
        return int(samples) + int(hot) + int(chunks) >= int(found.num_rows)

    def _named(self, machine: str, from_ms: int, to_ms: int, stored_class: int) -> tuple[int, int]:
        samples, newest = self._db.execute(_NAMED, (machine, to_ms, from_ms, int(stored_class))).fetchone()
        return int(samples), int(newest)
