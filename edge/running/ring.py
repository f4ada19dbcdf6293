"""The store of one edge: rows that nobody has confirmed yet, in a bounded ring on SQLite.

A row is one message to be. Its number (`sequence`) is given once and never again, over restarts and after deletion, so that a
reader who has a row twice can tell, and one who misses a row too. Rows and the place in the control's stream from which the
control has to be asked next are written in one transaction: a kill -9 loses neither, and takes none twice.

What is too much goes oldest first: past the age, the bytes, or where the disk is full (`edge.running.ring_file`).
"""

import json
import logging
import shutil
import sqlite3
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from edge.config import StoreSection
from edge.errors import StoreError
from edge.place import Place
from edge.running.ring_file import EVICTED_AT_ONCE, Eviction, open_ring, passed_limit, transaction

SPARE_PAGES, RETURNED_AT_ONCE = 1_000, 1_000
"""Pages that the file keeps for what comes; of more, so many are given back to the disk with each look."""
_log = logging.getLogger(__name__)
_SCHEMA = """
CREATE TABLE IF NOT EXISTS rows(
    sequence INTEGER PRIMARY KEY AUTOINCREMENT, stored_ms INTEGER NOT NULL, observations INTEGER NOT NULL, body TEXT NOT NULL,
    place TEXT, memory TEXT);
CREATE TABLE IF NOT EXISTS kept(name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TRIGGER IF NOT EXISTS number_once BEFORE INSERT ON rows
    WHEN NEW.sequence <= (SELECT seq FROM sqlite_sequence WHERE name = 'rows')
    BEGIN SELECT RAISE(ABORT, 'another edge writes this store too, and has given that number'); END;
CREATE TRIGGER IF NOT EXISTS keep_place_of_gone BEFORE DELETE ON rows
    WHEN OLD.place IS NOT NULL AND OLD.sequence > coalesce((SELECT CAST(value AS INTEGER) FROM kept WHERE name = 'place_of'), 0)
    BEGIN REPLACE INTO kept VALUES ('place', OLD.place), ('place_of', OLD.sequence); END;
CREATE TRIGGER IF NOT EXISTS keep_memory_of_gone BEFORE DELETE ON rows
    WHEN OLD.memory IS NOT NULL AND OLD.sequence > coalesce((SELECT CAST(value AS INTEGER) FROM kept WHERE name = 'memory_of'), 0)
    BEGIN REPLACE INTO kept VALUES ('memory', OLD.memory), ('memory_of', OLD.sequence); END;
INSERT OR IGNORE INTO kept SELECT of.column1, seq FROM (VALUES ('place_of'), ('memory_of')) AS of, sqlite_sequence AS numbers
    WHERE numbers.name = 'rows' AND EXISTS (SELECT 1 FROM sqlite_schema WHERE name = 'keep_place');
DROP TRIGGER IF EXISTS keep_place;
DROP TRIGGER IF EXISTS keep_memory;
"""
# A frame is one statement, and so one transaction, of one table: the place and the memory after it are in its last row. When that
# row goes, the triggers keep them, unless they have those of a later row. Stores of before had them kept at each row.
_ROWS_A_STATEMENT = 100
_KEEP = "INSERT OR REPLACE INTO kept VALUES (?, ?)"
_INSERT = "INSERT INTO rows VALUES (?, ?, ?, ?, ?, ?)"
_LOOK = """
SELECT (SELECT stored_ms FROM rows ORDER BY sequence LIMIT 1),
    (SELECT page_count FROM pragma_page_count), (SELECT freelist_count FROM pragma_freelist_count)
"""


class StoredRow(NamedTuple):
    """One message to be: its number, when it was stored (ms since 1970), how many observations it is, and its text."""

    sequence: int
    stored_ms: int
    observations: int
    body: str


class Evicted(NamedTuple):
    """Rows that had to go: how many, from and up to which number, and how many observations they were."""

    reason: Eviction
    rows: int
    first: int
    last: int
    observations: int


class Ring:
    """One file. One thread at a time; StoreError where the disk or the file fails.

    wall_ms: ms since 1970, asked once; clock: seconds from then on. The wall's clock may be set while we run (a gateway without a
        battery starts in 1970), and no row is to be thrown away for that.
    free_bytes: of the disk that holds a folder
    """

    def __init__(
        self,
        file: Path,
        limits: StoreSection,
        *,
        wall_ms: Callable[[], int],
        clock: Callable[[], float],
        free_bytes: Callable[[Path], int] = lambda folder: shutil.disk_usage(folder).free,
    ) -> None:
        self.file, self._limits, self._free_bytes = file, limits, free_bytes
        self._clock, self._began_s, self._began_ms = clock, clock(), wall_ms()
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._db = self._open()
        except (sqlite3.Error, OSError) as error:
            raise StoreError(f"{file}: cannot be used as a store: {error}") from error

    def _open(self) -> sqlite3.Connection:
        """The database; one that is damaged is put aside, under a name that says so, and a new one is begun."""
        try:
            return self._connect()
        except sqlite3.DatabaseError as error:
            if isinstance(error, sqlite3.OperationalError):
                raise
            aside = self.file.with_name(f"{self.file.name}.damaged-{self._now_ms()}")
            _log.warning("%s: is damaged (%s); it is kept as %s, and a new store is begun", self.file, error, aside.name)
            self.file.replace(aside)
            for tail in ("-wal", "-shm"):
                self.file.with_name(self.file.name + tail).unlink(missing_ok=True)
            db = self._connect()
            # The numbers that the lost store gave are unknown; they were fewer than one a millisecond since 1970.
            self.last = self._now_ms()
            db.execute("INSERT INTO sqlite_sequence VALUES ('rows', ?)", (self.last,))
            return db

    def _connect(self) -> sqlite3.Connection:
        db = open_ring(self.file, _SCHEMA, synchronous=self._limits.synchronous, timeout_s=1.0)
        try:
            found = db.execute("SELECT seq FROM sqlite_sequence WHERE name = 'rows'").fetchone()
            self.last = 0 if found is None else int(found[0])
            count, observations, newest = db.execute("SELECT count(*), sum(observations), max(stored_ms) FROM rows").fetchone()
            self.rows, self.observations = int(count), int(observations or 0)
            self._page_bytes = int(db.execute("PRAGMA page_size").fetchone()[0])
            self._began_ms = max(self._began_ms, int(newest or 0))
            self.age_s, self.bytes, self._spare_bytes = 0.0, 0, 0
        except BaseException:
            db.close()
            raise
        return db

    def _now_ms(self) -> int:
        return self._began_ms + round((self._clock() - self._began_s) * 1000)

    def close(self) -> None:
        """Close the file."""
        with suppress(sqlite3.Error):
            self._db.close()

    def append(self, rows: Sequence[tuple[int, str]], place: Place | None = None, memory: str | None = None) -> int:
        """Store rows (observations, body), and the place and memory after them, in one transaction; the number of the first."""
        first, stored_ms = self.last + 1, self._now_ms()
        numbered: list[tuple[Any, ...]] = [
            (first + i, stored_ms, observations, body, None, None) for i, (observations, body) in enumerate(rows)
        ]
        if numbered:
            numbered[-1] = (*numbered[-1][:4], None if place is None else json.dumps(place), memory)
        self._write(numbered)
        self.last += len(rows)
        self.rows += len(rows)
        self.observations += sum(observations for observations, _ in rows)
        return first

    def keep(self, place: Place, memory: str | None) -> None:
        """Store a place, and a memory that belongs to it, without a row."""
        values: dict[str, str | int] = {"place": json.dumps(place), "place_of": self.last}
        if memory is not None:
            values |= {"memory": memory, "memory_of": self.last}
        try:
            pairs = [part for pair in values.items() for part in pair]
            self._db.execute(_KEEP + ", (?, ?)" * (len(values) - 1), pairs)
        except sqlite3.Error as error:
            raise StoreError(f"{self.file}: cannot be written: {error}") from error

    def _write(self, numbered: Sequence[tuple[Any, ...]]) -> None:
        try:
            if len(numbered) <= _ROWS_A_STATEMENT:
                self._db.execute(
                    _INSERT + ", (?, ?, ?, ?, ?, ?)" * (len(numbered) - 1), [value for row in numbered for value in row]
                )
                return
            with transaction(self._db):
                self._db.executemany(_INSERT, numbered)
        except sqlite3.Error as error:
            raise StoreError(f"{self.file}: cannot be written: {error}") from error

    def place(self) -> Place | None:
        """The place that was stored last."""
        found = self._stored_last("place")
        if found is None:
            return None
        try:
            instance, next_sequence = json.loads(found)
        except ValueError:
            return None
        return Place(instance, next_sequence) if isinstance(instance, str) and type(next_sequence) is int else None

    def memory(self) -> str | None:
        """The memory that was stored last."""
        return self._stored_last("memory")

    def historian(self) -> str:
        """The host whose receipts are waited for, as kept; empty where there is none."""
        found = self._ask("SELECT value FROM kept WHERE name = 'historian'")
        return str(found[0][0]) if found else ""

    def keep_historian(self, host: str) -> None:
        """Keep over restarts whose receipts are waited for."""
        try:
            self._db.execute(_KEEP, ("historian", host))
        except sqlite3.Error as error:
            raise StoreError(f"{self.file}: cannot be written: {error}") from error

    def _stored_last(self, what: str) -> str | None:
        """Return the text of the last row that has one, or the one that was kept after that row."""
        kept = dict(self._ask(f"SELECT name, value FROM kept WHERE name IN ('{what}', '{what}_of')"))  # noqa: S608  our own words
        later = f"SELECT {what} FROM rows WHERE {what} IS NOT NULL AND sequence > ? ORDER BY sequence DESC LIMIT 1"  # noqa: S608
        found = self._ask(later, (int(kept.get(f"{what}_of", 0)),))
        return str(found[0][0]) if found else kept.get(what)

    def spans(self) -> list[tuple[int, int]]:
        """Return which numbers are stored, as spans from first to last."""
        # A row begins a span where the one before it is missing: number minus rank is the same within a span.
        asked = "SELECT min(sequence), max(sequence) FROM (SELECT sequence, sequence - row_number() OVER (ORDER BY sequence) AS g"
        return [(int(a), int(b)) for a, b in self._ask(f"{asked} FROM rows) GROUP BY g ORDER BY 1")]

    def read(self, first: int, last: int) -> list[StoredRow]:
        """The rows with these numbers that are there, in order."""
        asked = "SELECT sequence, stored_ms, observations, body FROM rows WHERE sequence BETWEEN ? AND ? ORDER BY sequence"
        return [StoredRow(*row) for row in self._ask(asked, (first, last))]

    def delete(self, first: int, last: int, observations: int) -> None:
        """Rows that are not needed any more, and how many observations they are."""
        try:
            self.rows -= self._db.execute("DELETE FROM rows WHERE sequence BETWEEN ? AND ?", (first, last)).rowcount
            self.observations -= observations
        except sqlite3.Error as error:
            raise StoreError(f"{self.file}: cannot be written: {error}") from error

    def forget(self, first: int, last: int) -> int:
        """Delete the rows with these numbers that are there; how many observations they were."""
        found = self._ask("SELECT sum(observations) FROM rows WHERE sequence BETWEEN ? AND ?", (first, last))
        observations = int(found[0][0] or 0)
        self.delete(first, last, observations)
        return observations

    def look(self) -> None:
        """See how old and how much it is: `age_s` and `bytes` are as of the last look."""
        oldest_ms, pages, spare = self._ask(_LOOK)[0]
        self.age_s = 0.0 if oldest_ms is None else max(self._now_ms() - int(oldest_ms), 0) / 1000
        self.bytes, self._spare_bytes = (int(pages) - int(spare)) * self._page_bytes, int(spare) * self._page_bytes
        if spare > SPARE_PAGES:
            self._give_back(RETURNED_AT_ONCE)

    def evict(self, upto: int) -> Evicted | None:
        """Evict the oldest rows with numbers up to `upto` where the last look found a limit passed, some at a time; else None."""
        reason = self._passed()
        if reason is None:
            return None
        asked = "SELECT sequence, stored_ms, observations FROM rows WHERE sequence <= ? ORDER BY sequence LIMIT ?"
        oldest = self._ask(asked, (upto, EVICTED_AT_ONCE))
        if reason is Eviction.AGE:
            limit_ms = self._now_ms() - round(self._limits.age_s_max * 1000)
            oldest = [row for row in oldest if row[1] < limit_ms]
        if not oldest:
            return None
        last, observations = int(oldest[-1][0]), sum(row[2] for row in oldest)
        self.delete(int(oldest[0][0]), last, observations)
        if reason is Eviction.DISK:
            self._give_back(RETURNED_AT_ONCE)
        self.look()
        return Evicted(reason, len(oldest), int(oldest[0][0]), last, observations)

    def _give_back(self, pages: int) -> None:
        """Make the file shorter by so many pages at most."""
        try:
            # As a script, for `execute` takes only its first step, which is one page; a checkpoint then makes the file shorter.
            self._db.executescript(f"PRAGMA incremental_vacuum({pages}); PRAGMA wal_checkpoint")
        except sqlite3.Error as error:
            raise StoreError(f"{self.file}: cannot be written: {error}") from error

    def _passed(self) -> Eviction | None:
        if not self.rows:
            return None
        return passed_limit(self._limits, age_s=self.age_s, size_bytes=self.bytes, free_bytes=self._free)

    def _free(self) -> int:
        try:
            return self._free_bytes(self.file.parent) + self._spare_bytes
        except OSError as error:
            raise StoreError(f"{self.file}: cannot read the free space of its disk: {error}") from error

    def _ask(self, text: str, values: Iterable[int] = ()) -> list[tuple[Any, ...]]:
        try:
            return self._db.execute(text, tuple(values)).fetchall()
        except sqlite3.Error as error:
            raise StoreError(f"{self.file}: cannot be read: {error}") from error
