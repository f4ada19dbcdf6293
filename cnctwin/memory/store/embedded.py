"""The store in a folder: SQLite for what is new, sealed hours in Parquet for what is not, one answer from both.

One process writes (`writer_lock`), any number of others read beside it.
"""

import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from cnctwin.memory.store import hot
from cnctwin.memory.store.answering import Answering
from cnctwin.memory.store.contract import (
    Appended,
    Column,
    Message,
    Pinned,
    Query,
    Sample,
    Series,
    Snapshot,
    Status,
    StoreError,
    Tidied,
    merged,
)
from cnctwin.memory.store.database import FILE_NAME, Readers
from cnctwin.memory.store.retention import Retention
from cnctwin.memory.store.store_status import status
from cnctwin.memory.store.writer import MARGIN_MS, PLACE, Writer


def _wall_ms() -> int:
    return time.time_ns() // 1_000_000


def _free_bytes(folder: Path) -> int:
    return shutil.disk_usage(folder).free


class EmbeddedStore:
    """A `Store` in a folder. Raises StoreError where it cannot be opened."""

    def __init__(
        self,
        folder: Path,
        *,
        writable: bool = False,
        retention: Retention | None = None,
        wall_ms: Callable[[], int] = _wall_ms,
        free_bytes: Callable[[Path], int] = _free_bytes,
        margin_ms: int = MARGIN_MS,
    ) -> None:
        self.folder, self._free_bytes = folder, free_bytes
        self._writing: Writer | None = None
        if writable:
            self._writing = Writer(folder, retention, wall_ms=wall_ms, free_bytes=free_bytes, margin_ms=margin_ms)
        elif not (folder / FILE_NAME).is_file():
            raise StoreError(f"{folder}: there is no store; it begins when the historian runs with this folder")
        self._readers = Readers(folder / FILE_NAME)
        self._answering = Answering(folder, self._readers)

    # What the one writer does.

    @property
    def _writer(self) -> Writer:
        if self._writing is None:
            raise StoreError(f"{self.folder}: this store was opened for reading only")
        return self._writing

    def append(self, messages: Sequence[Message]) -> Appended:
        """Keep messages; when this returns, neither a kill -9 nor the loss of power loses any."""
        return self._writer.append(messages)

    def append_from(self, messages: Sequence[Message], places: Mapping[str, int]) -> Appended:
        """Keep messages that come from logs, with the offset behind the last one of each log: all of it, or nothing."""
        return self._writer.append(messages, places)

    def places(self) -> dict[str, int]:
        """Return how far each log was read from which messages were appended."""
        with self._readers.snapshot() as db:
            rows = db.execute("SELECT name, value FROM meta WHERE substr(name, 1, ?) = ?", (len(PLACE), PLACE)).fetchall()
        return {str(name).removeprefix(PLACE): int(at) for name, at in rows}

    def pin(self, pinned: Pinned) -> None:
        """Keep a stretch from being swept."""
        self._writer.pin(pinned)

    def keep_snapshot(self, *snapshots: Snapshot) -> None:
        """Keep states of processors."""
        self._writer.keep_snapshot(*snapshots)

    def tidy(self, now_ms: int) -> Tidied:
        """Seal, roll up and sweep what is due, in bounded steps."""
        return self._writer.tidy(now_ms)

    def close(self) -> None:
        """Close it."""
        self._answering.close()
        self._readers.close()
        if self._writing is not None:
            self._writing.close()

    # What anybody may ask.

    def pins(self, machine: str | None = None) -> list[Pinned]:
        """Return all pins, oldest first; those of a machine that overlap are one, with all their reasons."""
        with self._readers.snapshot() as db:
            rows = db.execute("SELECT machine, from_ms, to_ms, reason FROM pins WHERE ?1 IS NULL OR machine = ?1", (machine,))
            return merged(Pinned(*row) for row in rows)

    def snapshot_before(self, processor: str, unit: str, at_ms: int) -> Snapshot | None:
        """The last snapshot that was received before a moment."""
        asked = """SELECT processor, unit, received_ms, payload FROM snapshots
            WHERE processor = ? AND unit = ? AND received_ms < ? ORDER BY received_ms DESC LIMIT 1"""
        with self._readers.snapshot() as db:
            row = db.execute(asked, (processor, unit, at_ms)).fetchone()
        return None if row is None else Snapshot(*row)

    def machines(self) -> list[str]:
        """All machines, by name."""
        with self._readers.snapshot() as db:
            return [str(name) for (name,) in db.execute("SELECT name FROM machines ORDER BY name")]

    def series(self, machine: str) -> list[Series]:
        """The signals of a machine, by name."""
        with self._readers.snapshot() as db:
            return hot.all_series(db, machine)

    def latest(self, machine: str) -> dict[str, Sample]:
        """The last sample of each signal."""
        with self._readers.snapshot() as db:
            return hot.latest(db, machine)

    def query(self, query: Query) -> list[Column]:
        """A column for each signal asked for, in that order."""
        return self._answering.query(query)

    def messages(self, machine: str, from_ms: int, to_ms: int) -> Iterator[Message]:
        """Yield the messages of a machine with received_ms in [from_ms, to_ms), in the order in which they came."""
        return self._answering.messages(machine, from_ms, to_ms)

    def status(self) -> Status:
        """Return the state of the store."""
        retention = None if self._writing is None else self._writing.retention
        with self._readers.snapshot() as db:
            return status(db, self.folder, retention, self._free_bytes, self._answering.checked.damaged.values())
