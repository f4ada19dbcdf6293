"""The part of the writer that needs the extra `historian`: sealing, roll-ups, sweeping, what lies there from before."""

import logging
import sqlite3
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

import pyarrow as pa

from cnctwin.memory.store.contract import StoreError, Tidied
from cnctwin.memory.store.database import transaction
from cnctwin.memory.store.retention import Retention
from cnctwin.memory.store.sealed.answers import SealedAnswers
from cnctwin.memory.store.sealed.late_history import LateHistory
from cnctwin.memory.store.sealed.left_over import LeftOver
from cnctwin.memory.store.sealed.manifest import DAY_MS, FOLDERS, Checked, File
from cnctwin.memory.store.sealed.rollup import roll_up
from cnctwin.memory.store.sealed.sealing import Sealer, set_aside
from cnctwin.memory.store.series_table import SeriesTable, StoredClass
from cnctwin.memory.store.store_status import SPARE_FREE_BYTES
from cnctwin.memory.store.sweep import beyond, past, sweep, sweep_log

SAMPLES_AT_ONCE = 300_000
"""About so many samples leave SQLite in one `tidy`, which holds up what is appended meanwhile: an hour of a machine."""
DAYS_AT_ONCE = 2
_log = logging.getLogger(__name__)


class SealedTier:
    """Works on the writer's connection, in its thread."""

    def __init__(
        self, db: sqlite3.Connection, file: Path, table: SeriesTable, *, margin_ms: int, free_bytes: Callable[[Path], int]
    ) -> None:
        self._db, self._file, self._folder, self._table = db, file, file.parent, table
        self._free_bytes, self._margin_ms = free_bytes, margin_ms
        self.checked = Checked(self._folder)
        self.late = LateHistory(db, table, self.checked)
        self._sealer = Sealer(db, file, table, self.checked, margin_ms)
        self._answers = SealedAnswers(self._folder)
        self._dirty = self._days_to_roll_up()
        self._next_sweep_ms = 0

    def close(self) -> None:
        """Give memory back."""
        self._answers.close()

    def tidy(self, retention: Retention, now_ms: int) -> Tidied:
        """Do what is due, in bounded steps. Raises StoreError."""
        try:
            return self._tidy(retention, now_ms)
        except FileNotFoundError as error:
            self.put_in_order()
            raise StoreError(f"{error.filename or error}: is gone; it is set aside, and the rest goes on in a minute") from error
        except (sqlite3.Error, OSError, pa.ArrowException) as error:
            raise StoreError(f"{self._folder}: cannot be tidied: {error}") from error
        finally:
            self.late.forget()

    def _tidy(self, retention: Retention, now_ms: int) -> Tidied:
        sealed = samples = 0
        left_over: list[str] = []
        for job in self._sealer.due(now_ms):
            done = self._sealer.seal(job)
            sealed += (job.to_ms - job.from_ms) // 3_600_000
            samples += done.samples
            left_over += done.left_over
            self._dirty.add((job.machine, job.from_ms // DAY_MS))
            if samples >= SAMPLES_AT_ONCE:
                self._sealer.look_again(job.machine)
                break
        left_over += self._roll_up(now_ms)
        swept, freed, pinned = self._sweep(retention, now_ms, left_over)
        self._remove(left_over)
        if samples:
            with suppress(sqlite3.Error):
                self._db.executescript("PRAGMA wal_checkpoint(PASSIVE); PRAGMA incremental_vacuum(2000)")
        return Tidied(sealed, swept, freed, pinned)

    def _roll_up(self, now_ms: int, *, at_once: int = DAYS_AT_ONCE, only: set[tuple[int, int]] | None = None) -> list[str]:
        """Roll up days that are over."""
        ready = [day for day in sorted(self._dirty) if only is None or day in only]
        ready = [day for day in ready if only is not None or (day[1] + 1) * DAY_MS + 2 * self._margin_ms <= now_ms]
        names = {number: name for name, number in self._table.machines.items()}
        left_over: list[str] = []
        for machine, day in ready[:at_once]:
            with transaction(self._db, self._file):
                left_over += roll_up(self._db, self._answers, self.checked, (machine, names[machine]), day)
            self._dirty.discard((machine, day))
        return left_over

    def _sweep(self, retention: Retention, now_ms: int, left_over: list[str]) -> tuple[int, int, int]:
        chosen, pinned = past(self._db, retention, now_ms)
        over = self._over_bytes(retention) - sum(file.bytes for file in chosen)
        if over > 0:
            taken = {file.id for file in chosen}
            chosen += [file for file in beyond(self._db, over, now_ms) if file.id not in taken]
        if now_ms >= self._next_sweep_ms:
            self._next_sweep_ms = now_ms + 3_600_000
            with transaction(self._db, self._file):
                sweep_log(self._db, retention, now_ms)
        if not chosen:
            return 0, 0, pinned
        days = {(file.machine, file.from_ms // DAY_MS) for file in chosen if file.stored_class == StoredClass.RAW}
        left_over += self._roll_up(now_ms, at_once=len(days), only=days & self._dirty)
        with transaction(self._db, self._file):
            freed = sweep(self._db, chosen)
        left_over += [file.name for file in chosen]
        return len(chosen), freed, pinned

    def _over_bytes(self, retention: Retention) -> int:
        """Return how many bytes the store is beyond its budget, or the disk short of its spare."""
        (sealed,) = self._db.execute("SELECT value FROM meta WHERE name = 'file_bytes'").fetchone()
        pages, spare, size = self._db.execute(
            "SELECT page_count, freelist_count, page_size FROM pragma_page_count, pragma_freelist_count, pragma_page_size"
        ).fetchone()
        over = 0 if retention.disk_bytes is None else int(sealed + (pages - spare) * size - retention.disk_bytes)
        try:
            return max(over, SPARE_FREE_BYTES - self._free_bytes(self._folder))
        except OSError as error:
            raise StoreError(f"{self._folder}: cannot read the free space of its disk: {error}") from error

    def _remove(self, names: Iterable[str]) -> None:
        for name in names:
            with suppress(OSError):
                (self._folder / name).unlink(missing_ok=True)

    def _days_to_roll_up(self) -> set[tuple[int, int]]:
        asked = f"""SELECT machine, from_ms / {DAY_MS} FROM files GROUP BY 1, 2
            HAVING max(CASE WHEN class IN (0, 2) AND state = 0 THEN id ELSE 0 END)
                > max(CASE WHEN class = 3 THEN id ELSE 0 END)"""  # noqa: S608
        return {(machine, day) for machine, day in self._db.execute(asked)}

    def put_in_order(self) -> None:
        """Files that a kill has left over are removed, others that nobody names are put aside (the database may be an old copy);
        named ones that are gone or too short are known as damaged."""
        named = {
            name: (identity, size)
            for identity, name, size in self._db.execute("SELECT id, name, bytes FROM files WHERE state = 0")
        }
        there: dict[str, int] = {}
        for folder in FOLDERS.values():
            for path in (self._folder / folder).rglob("*.parquet*"):
                if not path.name.endswith((".damaged", ".unnamed")):
                    there[str(path.relative_to(self._folder))] = path.stat().st_size
        left_over = LeftOver(self._db, self._folder)
        for name in sorted(there.keys() - named.keys()):
            if left_over.is_here(name):
                self._remove([name])
            else:
                said = "%s: not in the catalogue of the store; it is kept as %s.unnamed"
                _log.warning(said, self._folder / name, Path(name).name)
                (self._folder / name).replace(self._folder / (name + ".unnamed"))
        for name, (identity, size) in named.items():
            if there.get(name) == size:
                continue
            why = "is gone" if name not in there else f"has {there[name]} bytes, {size} were written"
            _log.warning("%s: %s; it is set aside, and the rest goes on", self._folder / name, why)
            row = self._db.execute("SELECT * FROM files WHERE id = ?", (identity,)).fetchone()
            with transaction(self._db, self._file):
                set_aside(self._db, self._folder, File(*row))
