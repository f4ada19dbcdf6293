"""The one writer of a store: what is appended, pinned and tidied, each step one transaction."""

import contextlib
import json
import logging
import sqlite3
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from cnctwin.files.synced import make_folder
from cnctwin.memory.store.contract import Appended, Message, Pinned, Snapshot, StoreError, Tidied
from cnctwin.memory.store.database import FILE_NAME, connect, insert, transaction
from cnctwin.memory.store.extra import MISSING, extra_is_there
from cnctwin.memory.store.intake import Batch, Known
from cnctwin.memory.store.retention import Retention
from cnctwin.memory.store.series_table import SeriesTable, Signal, StoredClass
from cnctwin.memory.store.store_status import FREE_BYTES_MIN
from cnctwin.memory.store.writer_lock import WriterLock

if TYPE_CHECKING:
    from cnctwin.memory.store.sealed.tier import SealedTier

MARGIN_MS = 600_000
PLACE = "read "
"""Before the name of a log among what the store knows of itself."""
NOWHERE: Mapping[str, int] = MappingProxyType({})
_log = logging.getLogger(__name__)


class Writer:
    """Holds the lock and the one connection that writes. One thread at a time."""

    def __init__(
        self,
        folder: Path,
        retention: Retention | None,
        *,
        wall_ms: Callable[[], int],
        free_bytes: Callable[[Path], int],
        margin_ms: int = MARGIN_MS,
    ) -> None:
        self.folder, self.file = folder, folder / FILE_NAME
        self._wall_ms, self._free_bytes = wall_ms, free_bytes
        self._is_damaged = self._must_load = False
        try:
            make_folder(folder)
            self._lock = WriterLock(folder, wall_ms())
        except OSError as error:
            raise StoreError(f"{folder}: cannot be a store: {error.strerror or error}") from None
        try:
            self.db = self._open()
            self._adopt()
            self.table = SeriesTable(self.db)
            (self._number,) = self.db.execute("SELECT value FROM meta WHERE name = 'number'").fetchone()
            self.retention = self._retention(retention)
            self._tier = self._sealed_tier(margin_ms)
        except sqlite3.Error as error:
            self._lock.release(is_clean=self._lock.was_clean and not is_damage(error))
            raise StoreError(f"{self.file}: cannot be used as a store: {error}") from error
        except BaseException:
            self._lock.release(is_clean=self._lock.was_clean)
            raise

    def _open(self) -> sqlite3.Connection:
        """The database; one that is damaged is put aside, under a name that says so, and a new one is begun."""
        try:
            db = connect(self.file, writable=True)
            if not self._lock.was_clean and (found := db.execute("PRAGMA quick_check(1)").fetchone()[0]) != "ok":
                db.close()
                raise sqlite3.DatabaseError(str(found).splitlines()[0])
        except sqlite3.DatabaseError as error:
            if isinstance(error, sqlite3.OperationalError):
                raise
            aside = self.file.with_name(f"{self.file.name}.damaged-{self._wall_ms()}")
            _log.warning("%s: is damaged (%s); it is kept as %s, and a new one is begun", self.file, error, aside.name)
            self.file.replace(aside)
            for tail in ("-wal", "-shm"):
                self.file.with_name(self.file.name + tail).unlink(missing_ok=True)
            db = connect(self.file, writable=True)
        return db

    def _adopt(self) -> None:
        """A database that was never used, in a folder that holds sealed hours: they are taken over."""
        if self.db.execute("SELECT 1 FROM machines LIMIT 1").fetchone() or not extra_is_there():
            return
        from cnctwin.memory.store.sealed.adoption import adopt  # noqa: PLC0415

        with transaction(self.db, self.file):
            if taken := adopt(self.db, self.folder):
                _log.warning("%s: %d sealed files were found here, and taken over", self.folder, taken)

    def _retention(self, told: Retention | None) -> Retention:
        """Return the retention that was given; else the one that was given last."""
        if told is None:
            found = self.db.execute("SELECT value FROM meta WHERE name = 'retention'").fetchone()
            return Retention() if found is None else Retention(**json.loads(found[0]))
        self.db.execute("INSERT OR REPLACE INTO meta VALUES ('retention', ?)", (json.dumps(asdict(told)),))
        return told

    def _sealed_tier(self, margin_ms: int) -> "SealedTier | None":
        """Raises StoreError where hours were sealed, and what reads them is not installed."""
        if not extra_is_there():
            if self.db.execute("SELECT 1 FROM files WHERE state = 0 LIMIT 1").fetchone():
                raise StoreError(f"{self.folder}: {MISSING}: sealed hours of this store cannot be read without them")
            return None
        from cnctwin.memory.store.sealed.tier import SealedTier  # noqa: PLC0415

        tier = SealedTier(self.db, self.file, self.table, margin_ms=margin_ms, free_bytes=self._free_bytes)
        tier.put_in_order()
        return tier

    def _nothing(self, signal: Signal, stored_class: StoredClass, stamp_ms: int) -> Sequence[Known]:
        return ()

    def append(self, messages: Sequence[Message], places: Mapping[str, int] = NOWHERE) -> Appended:
        """Keep messages, in one transaction, and in the same one how far each log was read that they come from."""
        self._check_disk()
        if self._must_load:
            self._load()
        batch = Batch(self.db, self.table, self._number, self._nothing if self._tier is None else self._tier.late)
        try:
            with transaction(self.db, self.file):
                done = batch.take(messages)
                insert(self.db, "INSERT OR REPLACE INTO meta VALUES", [(PLACE + log, at) for log, at in places.items()])
        except BaseException as error:
            self._note(error)
            self._must_load = True  # what was begun is in memory, and not on the disk
            raise
        self._number = batch.number
        return done

    def _load(self) -> None:
        try:
            self.table.load()
        except sqlite3.Error as error:
            self._note(error)
            raise StoreError(f"{self.file}: cannot be read: {error}") from error
        self._must_load = False

    def _note(self, error: BaseException) -> None:
        """Damage is looked for, and put aside, by the next writer."""
        self._is_damaged |= is_damage(error) or is_damage(error.__cause__)

    def _check_disk(self) -> None:
        try:
            free = self._free_bytes(self.folder)
        except OSError as error:
            raise StoreError(f"{self.folder}: cannot read the free space of its disk: {error}") from error
        if free < FREE_BYTES_MIN:
            left, needed = free // 1_000_000, FREE_BYTES_MIN // 1_000_000
            raise StoreError(
                f"{self.folder}: the disk has {left} MB left, {needed} MB are needed to take more; make room, "
                "or give the store a smaller disk_bytes"
            )

    def pin(self, pinned: Pinned) -> None:
        """Keep a stretch from being swept."""
        if pinned.to_ms <= pinned.from_ms:
            raise StoreError(f"pin of {pinned.machine}: to {pinned.to_ms} is not after from {pinned.from_ms}")
        with transaction(self.db, self.file):
            self.db.execute("INSERT OR IGNORE INTO pins VALUES (?, ?, ?, ?)", pinned)

    def keep_snapshot(self, *snapshots: Snapshot) -> None:
        """Keep states of processors."""
        with transaction(self.db, self.file):
            insert(self.db, "INSERT OR REPLACE INTO snapshots VALUES", snapshots)

    def tidy(self, now_ms: int) -> Tidied:
        """Do what is due; without the extra `historian` nothing is, since SQLite keeps all."""
        if self._tier is None:
            return Tidied(0, 0, 0, 0)
        if self._must_load:
            self._load()
        try:
            return self._tier.tidy(self.retention, now_ms)
        except StoreError as error:
            self._note(error)
            raise

    def close(self) -> None:
        """Close the file and let go of the lock."""
        if self._tier is not None:
            self._tier.close()
        with contextlib.suppress(sqlite3.Error):
            self.db.close()
        self._lock.release(is_clean=not self._is_damaged)


def is_damage(error: BaseException | None) -> bool:
    """Return True if SQLite says that the file is not what it wrote; its other errors are of classes of their own."""
    return type(error) is sqlite3.DatabaseError
