"""The shared part of the bounded rings: a transaction is all or nothing, and the limits have an order."""

import sqlite3
from pathlib import Path

import pytest

from edge.config import StoreSection
from edge.running.ring_file import Eviction, open_ring, passed_limit, transaction

SCHEMA = "CREATE TABLE IF NOT EXISTS rows(sequence INTEGER PRIMARY KEY)"
LIMITS = StoreSection(age_s_max=10.0, bytes_max=1_000_000, free_bytes_min=500)


def test_a_transaction_that_fails_leaves_nothing(tmp_path: Path) -> None:
    db = open_ring(tmp_path / "ring", SCHEMA, synchronous="normal", timeout_s=1.0)
    with transaction(db):
        db.execute("INSERT INTO rows VALUES (1)")
    with pytest.raises(sqlite3.IntegrityError), transaction(db):
        db.execute("INSERT INTO rows VALUES (2)")
        db.execute("INSERT INTO rows VALUES (1)")
    db.close()
    again = open_ring(tmp_path / "ring", SCHEMA, synchronous="full", timeout_s=1.0)
    assert again.execute("SELECT sequence FROM rows").fetchall() == [(1,)]
    assert again.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    assert again.execute("PRAGMA auto_vacuum").fetchone() == (2,)
    again.close()


@pytest.mark.parametrize(
    ("age_s", "size_bytes", "free_bytes", "expected"),
    [
        (10.0, 1_000_000, 500, None),
        (10.1, 1_000_001, 499, Eviction.AGE),
        (10.0, 1_000_001, 499, Eviction.BYTES),
        (10.0, 1_000_000, 499, Eviction.DISK),
    ],
)
def test_age_comes_before_bytes_and_bytes_before_the_disk(
    age_s: float, size_bytes: int, free_bytes: int, expected: Eviction | None
) -> None:
    assert passed_limit(LIMITS, age_s=age_s, size_bytes=size_bytes, free_bytes=lambda: free_bytes) is expected


def test_the_disk_is_not_looked_at_where_another_limit_is_passed() -> None:
    def unreadable() -> int:
        raise OSError

    assert passed_limit(LIMITS, age_s=11.0, size_bytes=0, free_bytes=unreadable) is Eviction.AGE
