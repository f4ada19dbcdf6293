"""The file of a bounded ring on SQLite: how it is opened, how it is written, and when a limit is passed.

WAL (https://sqlite.org/wal.html): with synchronous=NORMAL a commit survives the death of the process, with FULL that of the power
too, at the price of an fsync each. The store of an edge (`edge.running.ring`) and the spool before InfluxDB are such rings;
what a row is and what else is in its transaction is their own.
"""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from enum import StrEnum
from pathlib import Path
from typing import Protocol

EVICTED_AT_ONCE = 200
"""Rows; more would hold up what is live."""


class Eviction(StrEnum):
    """Why a row had to go before anybody had it."""

    AGE = "age"
    BYTES = "bytes"
    DISK = "disk"


class Limits(Protocol):
    """Limits of a ring; less than `free_bytes_min` is never left on the disk."""

    @property
    def age_s_max(self) -> float: ...
    @property
    def bytes_max(self) -> int: ...
    @property
    def free_bytes_min(self) -> int: ...


def open_ring(file: Path, schema: str, *, synchronous: str, timeout_s: float) -> sqlite3.Connection:
    """Return the database of this file with its tables. Raises sqlite3.Error.

    synchronous: "normal" or "full"; timeout_s: how long a lock of another connection is waited for
    """
    db = sqlite3.connect(file, isolation_level=None, timeout=timeout_s, check_same_thread=False)
    try:
        db.execute("PRAGMA auto_vacuum = INCREMENTAL")
        db.execute("PRAGMA journal_mode = WAL")
        db.execute(f"PRAGMA synchronous = {synchronous}")
        db.execute("PRAGMA journal_size_limit = 4194304")
        db.executescript(schema)
    except BaseException:
        db.close()
        raise
    return db


@contextmanager
def transaction(db: sqlite3.Connection) -> Iterator[None]:
    """All of it is written, or nothing."""
    db.execute("BEGIN IMMEDIATE")
    try:
        yield
        db.execute("COMMIT")
    except BaseException:
        with suppress(sqlite3.Error):
            db.execute("ROLLBACK")
        raise


def passed_limit(limits: Limits, *, age_s: float, size_bytes: int, free_bytes: Callable[[], int]) -> Eviction | None:
    """Return the first limit that a ring with rows has passed; the disk is looked at last.

    age_s: of the oldest row
    """
    if age_s > limits.age_s_max:
        return Eviction.AGE
    if size_bytes > limits.bytes_max:
        return Eviction.BYTES
    return Eviction.DISK if free_bytes() < limits.free_bytes_min else None
