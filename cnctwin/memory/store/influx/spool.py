"""The ring on the disk before the server: batches of lines that it has not taken yet, and what has to be remembered of them.

One SQLite file (`edge.running.ring_file`; a commit outlives a kill -9 and the loss of power). In one transaction go: the
batches, the stamps by which a sample is known that comes again, and the account `taken = sent + refused + evicted + held`, of
samples. What is too old or too much goes oldest first and is counted by reason. Two writers cannot share a folder: a lock file
sees to that.
"""

import fcntl
import shutil
import sqlite3
import zlib
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import RLock
from typing import Any, NamedTuple

from cnctwin.files.synced import make_folder
from cnctwin.memory.store.contract import Pinned, StoreError
from edge.running.ring_file import EVICTED_AT_ONCE, Eviction, open_ring, passed_limit, transaction

FILE, LOCK = "ring.sqlite", "writer.lock"
_SCHEMA = """
CREATE TABLE IF NOT EXISTS rows(sequence INTEGER PRIMARY KEY AUTOINCREMENT, stored_ms INTEGER NOT NULL,
    oldest_ms INTEGER NOT NULL, bucket TEXT NOT NULL, samples INTEGER NOT NULL, bytes INTEGER NOT NULL, body BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS account(name TEXT PRIMARY KEY, samples INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS series(id INTEGER PRIMARY KEY, machine TEXT, node TEXT, signal TEXT, UNIQUE(machine, node, signal));
CREATE TABLE IF NOT EXISTS stamps(series INTEGER, ms INTEGER, told BLOB NOT NULL, is_stale INTEGER NOT NULL,
    PRIMARY KEY(series, ms)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS texts(signal TEXT, text TEXT, PRIMARY KEY(signal, text)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS pins(machine TEXT, from_ms INTEGER, to_ms INTEGER, reason TEXT, after_sequence INTEGER NOT NULL,
    copied_ms INTEGER NOT NULL, PRIMARY KEY(machine, from_ms, to_ms, reason)) WITHOUT ROWID;
"""


@dataclass(frozen=True, slots=True)
class RingLimits:
    """The room for what waits for the server; less than `free_bytes_min` is never left on the disk."""

    bytes_max: int = 4_000_000_000
    age_s_max: float = 7 * 86_400.0
    free_bytes_min: int = 500_000_000


class Batch(NamedTuple):
    """Lines for one bucket: how many samples they are, and the oldest of them."""

    bucket: str
    samples: int
    oldest_ms: int
    lines: bytes


class Waiting(NamedTuple):
    """A batch in the ring."""

    sequence: int
    bucket: str
    samples: int
    lines: bytes


class PinnedCopy(NamedTuple):
    """A pin and how far the samples that were there before it have been copied; they wait until the ring is past a number."""

    pinned: Pinned
    after_sequence: int
    copied_ms: int


class Spool:
    """The ring of one folder; any thread."""

    def __init__(
        self,
        folder: Path,
        limits: RingLimits,
        *,
        wall_ms: Callable[[], int],
        free_bytes: Callable[[Path], int] = lambda folder: shutil.disk_usage(folder).free,
    ) -> None:
        self.folder, self._limits, self._wall_ms, self._free_bytes = folder, limits, wall_ms, free_bytes
        self._lock = RLock()
        try:
            make_folder(folder)
            self._owner = (folder / LOCK).open("w")
            try:
                fcntl.flock(self._owner, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                self._owner.close()
                raise StoreError(f"{folder}: another process writes to this ring; stop it or name another folder") from error
            self._db = open_ring(folder / FILE, _SCHEMA, synchronous="full", timeout_s=5.0)
            sums = "SELECT coalesce(sum(samples), 0), coalesce(sum(bytes), 0) FROM rows"
            held, size = self._db.execute(sums).fetchone()
            self.held, self.bytes = int(held), int(size)
            given = self._db.execute("SELECT coalesce(max(seq), 0) FROM sqlite_sequence WHERE name = 'rows'").fetchone()
            self.last = int(given[0])
        except (sqlite3.Error, OSError) as error:
            raise StoreError(f"{folder}: cannot hold the ring: {error}; look at the disk, or move the folder away") from error

    def close(self) -> None:
        """Close the file and let go of the folder."""
        with self._lock, suppress(sqlite3.Error):
            self._db.close()
        self._owner.close()

    def put(
        self,
        batches: Sequence[Batch],
        stamps: Iterable[tuple[int, int, bytes, bool]] = (),
        counted: Iterable[tuple[str, int]] = (),
    ) -> None:
        """Keep batches, stamps (series, ms, what was told, whether stale) and additions to the account, all or nothing."""
        try:
            self._put(batches, stamps, counted)
        except sqlite3.OperationalError as error:
            if "full" not in str(error) or not self._evict(Eviction.DISK):
                raise self._unwritable(error) from error
            try:
                self._put(batches, stamps, counted)
            except sqlite3.Error as again:
                raise self._unwritable(again) from again
        except sqlite3.Error as error:
            raise self._unwritable(error) from error

    def _put(
        self, batches: Sequence[Batch], stamps: Iterable[tuple[int, int, bytes, bool]], counted: Iterable[tuple[str, int]]
    ) -> None:
        now_ms = self._wall_ms()
        packed = [(now_ms, b.oldest_ms, b.bucket, b.samples, zlib.compress(b.lines, 1)) for b in batches]
        with self._lock:
            samples = sum(b.samples for b in batches)
            with transaction(self._db):
                self._db.executemany(
                    "INSERT INTO rows(stored_ms, oldest_ms, bucket, samples, bytes, body) VALUES (?, ?, ?, ?, ?, ?)",
                    [(*row[:4], len(row[4]), row[4]) for row in packed],
                )
                self._db.executemany("INSERT OR REPLACE INTO stamps VALUES (?, ?, ?, ?)", stamps)
                self._count([("taken", samples), *counted])
            self.held += samples
            self.bytes += sum(len(row[4]) for row in packed)
            self.last += len(packed)

    def _count(self, counted: Iterable[tuple[str, int]]) -> None:
        add = "INSERT INTO account VALUES (?, ?) ON CONFLICT(name) DO UPDATE SET samples = samples + excluded.samples"
        self._db.executemany(add, counted)

    def after(self, sequence: int, samples_max: int) -> list[Waiting]:
        """The batches behind a number, oldest first: one at least where there is one, together about `samples_max` samples."""
        found: list[Waiting] = []
        total = 0
        rows = self._ask("SELECT sequence, bucket, samples FROM rows WHERE sequence > ? ORDER BY sequence LIMIT 256", (sequence,))
        for number, bucket, samples in rows:
            if found and total + samples > samples_max:
                break
            body = self._ask("SELECT body FROM rows WHERE sequence = ?", (number,))
            if body:
                found.append(Waiting(number, bucket, samples, zlib.decompress(body[0][0])))
                total += samples
        return found

    def done(self, upto: int, refused: int = 0) -> None:
        """All batches up to a number are with the server, but for so many samples that it refused."""
        with self._lock:
            try:
                with transaction(self._db):
                    samples, size = self._db.execute(
                        "SELECT coalesce(sum(samples), 0), coalesce(sum(bytes), 0) FROM rows WHERE sequence <= ?", (upto,)
                    ).fetchone()
                    self._db.execute("DELETE FROM rows WHERE sequence <= ?", (upto,))
                    self._count([("sent", samples - refused), ("refused by the server", refused)])
            except sqlite3.Error as error:
                raise self._unwritable(error) from error
            self.held -= samples
            self.bytes -= size

    def sweep(self) -> int:
        """Let go what is past the limits; how many samples that were."""
        gone = 0
        while (reason := self._passed()) is not None:
            evicted = self._evict(reason)
            if not evicted:
                break
            gone += evicted
        with suppress(sqlite3.Error):
            self._db.executescript("PRAGMA incremental_vacuum(2000)")
        return gone

    def _passed(self) -> Eviction | None:
        oldest = self._ask("SELECT stored_ms FROM rows ORDER BY sequence LIMIT 1")
        if not oldest:
            return None
        age_s = (self._wall_ms() - oldest[0][0]) / 1000
        free_bytes = partial(self._free_bytes, self.folder)
        return passed_limit(self._limits, age_s=age_s, size_bytes=self.bytes, free_bytes=free_bytes)

    def _evict(self, reason: Eviction) -> int:
        with self._lock:
            rows = self._ask("SELECT sequence, samples, bytes FROM rows ORDER BY sequence LIMIT ?", (EVICTED_AT_ONCE,))
            excess, chosen = self.bytes - self._limits.bytes_max, []
            limit_ms = self._wall_ms() - self._limits.age_s_max * 1000
            if reason is Eviction.AGE:
                asked = "SELECT sequence, samples, bytes FROM rows WHERE stored_ms < ? ORDER BY sequence LIMIT ?"
                rows = self._ask(asked, (limit_ms, EVICTED_AT_ONCE))
            for row in rows:
                if reason is Eviction.BYTES and excess <= 0:
                    break
                chosen.append(row)
                excess -= row[2]
            if not chosen:
                return 0
            samples: int = sum(row[1] for row in chosen)
            try:
                with transaction(self._db):
                    self._db.executemany("DELETE FROM rows WHERE sequence = ?", [(row[0],) for row in chosen])
                    self._count([(f"evicted: {reason}", samples)])
            except sqlite3.Error as error:
                raise self._unwritable(error) from error
            self.held -= samples
            self.bytes -= sum(row[2] for row in chosen)
            return samples

    def account(self) -> dict[str, int]:
        """Return how many samples went where, since the folder was made; `held` is what is in the ring now."""
        with self._lock:
            return {**dict(self._ask("SELECT name, samples FROM account")), "held": self.held}

    def ask(self, text: str, values: Iterable[Any] = ()) -> list[tuple[Any, ...]]:
        """Rows of a SELECT."""
        return self._ask(text, values)

    def _ask(self, text: str, values: Iterable[Any] = ()) -> list[tuple[Any, ...]]:
        try:
            with self._lock:
                return self._db.execute(text, tuple(values)).fetchall()
        except sqlite3.Error as error:
            raise StoreError(f"{self.folder / FILE}: cannot be read: {error}") from error

    def write(self, text: str, values: Iterable[Any] = ()) -> int:
        """One statement of its own that changes something; how many rows."""
        try:
            with self._lock:
                return self._db.execute(text, tuple(values)).rowcount
        except sqlite3.Error as error:
            raise self._unwritable(error) from error

    def _unwritable(self, error: sqlite3.Error) -> StoreError:
        return StoreError(f"{self.folder / FILE}: cannot be written: {error}; give its disk room")
