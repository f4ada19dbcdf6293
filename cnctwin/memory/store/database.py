"""The SQLite file of a store: its tables, how it is opened, and the connections of those who only ask.

`chunks` are DATA messages as columns, which nearly all are (`chunk`). `events` are the others, one row a message; what the
readings of such a one said lies in `samples`, by series and time, and a BIRTH or DEATH keeps its readings whole in `body` beside
that. All are numbered in the order of arrival. `files` is the manifest of the sealed hours. A reader who takes the manifest and
the hot rows in one transaction sees each sample once.

WAL with synchronous=FULL (https://sqlite.org/wal.html): each commit is forced to the disk, so what was committed survives a kill
-9 and the loss of power. That is one fsync a batch, whatever its size.
"""

import sqlite3
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path
from typing import Any

from cnctwin.memory.store.contract import StoreError

FILE_NAME = "store.sqlite"
VERSION, VERSIONS = 2, (0, 1, 2)
"""Version 1 had no chunks; a store of it is read as it is, and becomes one of version 2 when it is written."""
ROWS_AT_ONCE = 256
CONNECTIONS_KEPT = 4
BUSY_S = 10.0
SCHEMA = """
CREATE TABLE IF NOT EXISTS meta(name TEXT PRIMARY KEY, value) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS machines(id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE);
CREATE TABLE IF NOT EXISTS nodes(id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE);
CREATE TABLE IF NOT EXISTS reasons(id INTEGER PRIMARY KEY, text TEXT NOT NULL UNIQUE);
CREATE TABLE IF NOT EXISTS signals(
    id INTEGER PRIMARY KEY, machine INTEGER NOT NULL, node INTEGER NOT NULL, name TEXT NOT NULL,
    UNIQUE(machine, node, name));
CREATE TABLE IF NOT EXISTS series(
    sid INTEGER PRIMARY KEY, signal INTEGER NOT NULL, unit TEXT, kind INTEGER NOT NULL, class INTEGER NOT NULL);
CREATE INDEX IF NOT EXISTS series_of_signal ON series(signal);
CREATE TABLE IF NOT EXISTS latest(
    signal INTEGER PRIMARY KEY, sid INTEGER NOT NULL, first_us INTEGER NOT NULL, last_us INTEGER NOT NULL,
    value, flag INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS samples(
    sid INTEGER NOT NULL, t INTEGER NOT NULL, value, flag INTEGER NOT NULL, number INTEGER NOT NULL,
    PRIMARY KEY(sid, t)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS events(
    number INTEGER PRIMARY KEY, received_ms INTEGER NOT NULL, machine INTEGER, node INTEGER NOT NULL, kind INTEGER NOT NULL,
    stamp_ms INTEGER NOT NULL, detail TEXT, body BLOB, place BLOB, from_ms INTEGER, to_ms INTEGER);
CREATE INDEX IF NOT EXISTS events_of_machine ON events(machine, number, received_ms);
CREATE INDEX IF NOT EXISTS events_of_node ON events(node, number) WHERE machine IS NULL;
CREATE TABLE IF NOT EXISTS chunks(
    number INTEGER PRIMARY KEY, machine INTEGER NOT NULL, minute INTEGER NOT NULL, class INTEGER NOT NULL, node INTEGER NOT NULL,
    last_number INTEGER NOT NULL, first_received_ms INTEGER NOT NULL, last_received_ms INTEGER NOT NULL,
    samples INTEGER NOT NULL, body BLOB NOT NULL);
CREATE INDEX IF NOT EXISTS chunks_of_machine ON chunks(
    machine, minute, class, number, last_number, first_received_ms, last_received_ms, samples);
CREATE TABLE IF NOT EXISTS files(
    id INTEGER PRIMARY KEY AUTOINCREMENT, class INTEGER NOT NULL, machine INTEGER NOT NULL, from_ms INTEGER NOT NULL,
    to_ms INTEGER NOT NULL, name TEXT NOT NULL, state INTEGER NOT NULL, bytes INTEGER NOT NULL, crc INTEGER NOT NULL,
    samples INTEGER NOT NULL, first_number INTEGER NOT NULL, last_number INTEGER NOT NULL, first_received_ms INTEGER NOT NULL,
    last_received_ms INTEGER NOT NULL, columns TEXT NOT NULL);
CREATE INDEX IF NOT EXISTS files_by_time ON files(machine, from_ms);
CREATE INDEX IF NOT EXISTS files_by_age ON files(state, class, from_ms);
CREATE TABLE IF NOT EXISTS pins(
    machine TEXT NOT NULL, from_ms INTEGER NOT NULL, to_ms INTEGER NOT NULL, reason TEXT NOT NULL,
    PRIMARY KEY(machine, from_ms, to_ms, reason)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS snapshots(
    processor TEXT NOT NULL, unit TEXT NOT NULL, received_ms INTEGER NOT NULL, payload BLOB NOT NULL,
    PRIMARY KEY(processor, unit, received_ms));
INSERT OR IGNORE INTO meta VALUES ('samples', 0), ('file_bytes', 0), ('number', 0);
CREATE TRIGGER IF NOT EXISTS file_added AFTER INSERT ON files
    BEGIN UPDATE meta SET value = value + NEW.bytes WHERE name = 'file_bytes'; END;
CREATE TRIGGER IF NOT EXISTS file_removed AFTER DELETE ON files
    BEGIN UPDATE meta SET value = value - OLD.bytes WHERE name = 'file_bytes'; END;
CREATE TRIGGER IF NOT EXISTS file_changed AFTER UPDATE OF bytes ON files
    BEGIN UPDATE meta SET value = value + NEW.bytes - OLD.bytes WHERE name = 'file_bytes'; END;
"""
_NO_CHUNKS = "\n".join(
    statement.replace("IF NOT EXISTS chunks", "temp.chunks").replace("INDEX IF NOT EXISTS ", "INDEX temp.") + ";"
    for statement in SCHEMA.split(";\n")
    if "chunks" in statement
)
"""In place of the table that a store of version 1 lacks."""


def connect(file: Path, *, writable: bool) -> sqlite3.Connection:
    """A connection to the file; sqlite3.Error where it cannot be had."""
    db = sqlite3.connect(file, isolation_level=None, timeout=BUSY_S, check_same_thread=False, cached_statements=256)
    try:
        if writable:
            db.execute("PRAGMA auto_vacuum = INCREMENTAL")
            db.execute("PRAGMA journal_mode = WAL")
            db.execute("PRAGMA synchronous = FULL")
            db.execute("PRAGMA journal_size_limit = 16777216")
            db.execute("PRAGMA cache_size = -16384")
        else:
            db.execute("PRAGMA cache_size = -4096")
        found = version(db)
        if found not in VERSIONS:
            raise StoreError(
                f"{file}: is a store of version {found}, this program knows {VERSION}; use the program that wrote it"
            )
        if writable:
            db.executescript(f"BEGIN; {SCHEMA} PRAGMA user_version = {VERSION}; COMMIT")
        else:
            if found == 1:
                db.executescript(_NO_CHUNKS)
            db.execute("PRAGMA query_only = ON")
    except BaseException:
        db.close()
        raise
    return db


def version(db: sqlite3.Connection) -> int:
    """The version of a store; 0: it has just begun."""
    return int(db.execute("PRAGMA user_version").fetchone()[0])


def insert(db: sqlite3.Connection, what: str, rows: Sequence[tuple[Any, ...]]) -> None:
    """Insert rows, many with each statement: a thread lets go of the interpreter at each, and has to get hold of it again."""
    at = 0
    while at < len(rows):
        count = min(ROWS_AT_ONCE, 1 << (len(rows) - at).bit_length() - 1)  # few statements, which stay prepared
        places = ", ".join([f"({', '.join('?' * len(rows[0]))})"] * count)
        db.execute(f"{what} {places}", list(chain.from_iterable(rows[at : at + count])))
        at += count


@contextmanager
def transaction(db: sqlite3.Connection, file: Path) -> Iterator[sqlite3.Connection]:
    """All of it or nothing; the loss of power does not undo it either. Raises StoreError where it cannot be written."""
    try:
        db.execute("BEGIN IMMEDIATE")
        try:
            yield db
            db.execute("COMMIT")
        except BaseException:
            with suppress(sqlite3.Error):
                db.execute("ROLLBACK")
            raise
    except sqlite3.Error as error:
        raise StoreError(f"{file}: cannot be written: {error}") from error


class Readers:
    """Connections for questions, from any thread; a few are kept for the next one."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self._lock, self._kept, self._closed = threading.Lock(), list[sqlite3.Connection](), False
        self._of: tuple[int, int] | None = None  # which file those that are kept have open

    @contextmanager
    def snapshot(self) -> Iterator[sqlite3.Connection]:
        """A connection that sees one state of the store as long as it is held. Raises StoreError where it cannot be read."""
        try:
            db, of = self._take()
            try:
                db.execute("BEGIN")
                yield db
            finally:
                self._give(db, of)
        except sqlite3.Error as error:
            raise StoreError(f"{self.file}: cannot be read: {error}") from error

    def _take(self) -> tuple[sqlite3.Connection, tuple[int, int]]:
        now = self._which()
        with self._lock:
            if now == self._of and self._kept:
                return self._kept.pop(), now
            old: list[sqlite3.Connection] = []
            if now != self._of:
                old, self._kept, self._of = self._kept, [], now
        for db in old:  # the store was begun again beside us
            db.close()
        return connect(self.file, writable=False), now

    def _which(self) -> tuple[int, int]:
        try:
            found = self.file.stat()
        except OSError as error:
            raise StoreError(f"{self.file}: cannot be read: {error.strerror or error}; is the store there?") from error
        return found.st_dev, found.st_ino

    def _give(self, db: sqlite3.Connection, of: tuple[int, int]) -> None:
        try:
            db.execute("ROLLBACK" if db.in_transaction else "SELECT 1")
            is_old = db.execute("SELECT 1 FROM temp.sqlite_master LIMIT 1").fetchone() is not None  # its writer may bring it up
        except sqlite3.Error:
            db.close()
            return
        with self._lock:
            is_kept = not (is_old or self._closed) and of == self._of and len(self._kept) < CONNECTIONS_KEPT
            if is_kept:
                self._kept.append(db)
                return
        db.close()

    def close(self) -> None:
        """Close what is kept."""
        with self._lock:
            self._closed = True
            kept, self._kept = self._kept, []
        for db in kept:
            db.close()
