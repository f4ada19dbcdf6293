"""Sweeping: what is past its time goes, and beyond the disk's budget the oldest raw; what is pinned, derived or rolled up never.

A file is swept or kept whole: a pin keeps the files that it touches. A swept file stays in the manifest without its bytes, so
that history which comes for it later is known to be too late.
"""

import sqlite3
from collections.abc import Sequence

from cnctwin.memory.store.chunk_writer import STAMP_MS_MAX
from cnctwin.memory.store.retention import Retention
from cnctwin.memory.store.sealed.manifest import DAY_MS, HOUR_MS, File, State
from cnctwin.memory.store.series_table import StoredClass

FILES_AT_ONCE = 200
EVENTS_AT_ONCE = 2_000
SNAPSHOTS_FULL_DAYS = 7
"""Older snapshots of processors are kept once a day, as long as the raw is, those before a pin all."""


_PAST = """
FROM files JOIN machines ON machines.id = files.machine
WHERE state = 0 AND class = ?1 AND from_ms < ?2 AND to_ms <= ?2 AND (last_received_ms < ?2 OR last_received_ms > ?3)
    AND {}EXISTS (SELECT 1 FROM pins
        WHERE pins.machine = machines.name AND pins.from_ms < files.to_ms AND pins.to_ms > files.from_ms)
"""
_FREE = f"SELECT files.* {_PAST.format('NOT ')} ORDER BY from_ms LIMIT ?4"
_PINNED = f"SELECT count(*) {_PAST.format('')}"


def past(db: sqlite3.Connection, retention: Retention, now_ms: int) -> tuple[list[File], int]:
    """Files past their time, oldest first, and how many a pin holds."""
    found: list[File] = []
    pinned = 0
    for stored_class, days in ((StoredClass.RAW, retention.raw_days), (StoredClass.BLOCK, retention.block_days)):
        limit_ms = now_ms - round(days * DAY_MS)
        some, held = _free(db, stored_class, limit_ms, now_ms)
        found += some
        pinned += held
    return found, pinned


def _free(db: sqlite3.Connection, stored_class: StoredClass, limit_ms: int, now_ms: int) -> tuple[list[File], int]:
    """Some of the oldest files of a class that end before a limit and that no pin holds, and how many pins hold.

    What came after the limit is not past it, whatever its stamps say: a machine whose clock stands in 1970 is kept as long as any
    other. (Where it came in our own future, our clock was wrong, and the stamps decide.)
    """
    asked = (int(stored_class), limit_ms, now_ms + DAY_MS)
    free = [File(*row) for row in db.execute(_FREE, (*asked, FILES_AT_ONCE)).fetchall()]
    return free, int(db.execute(_PINNED, asked).fetchone()[0])


def beyond(db: sqlite3.Connection, over_bytes: int, now_ms: int) -> list[File]:
    """The oldest raw files that no pin holds, as many as give so many bytes back."""
    raw, _ = _free(db, StoredClass.RAW, STAMP_MS_MAX, now_ms)
    blocks, _ = _free(db, StoredClass.BLOCK, STAMP_MS_MAX, now_ms)
    chosen: list[File] = []
    for file in sorted([*raw, *blocks], key=lambda file: file.from_ms):
        if over_bytes <= 0:
            break
        chosen.append(file)
        over_bytes -= file.bytes
    return chosen


def sweep(db: sqlite3.Connection, chosen: Sequence[File]) -> int:
    """Take files out of the manifest, within a transaction; the bytes that this gives back once they are removed."""
    db.executemany(f"UPDATE files SET state = {int(State.SWEPT)}, bytes = 0 WHERE id = ?", [(file.id,) for file in chosen])  # noqa: S608
    db.execute("UPDATE meta SET value = value - ? WHERE name = 'samples'", (sum(file.samples for file in chosen),))
    return sum(file.bytes for file in chosen)


def sweep_log(db: sqlite3.Connection, retention: Retention, now_ms: int) -> None:
    """Births, deaths and holes past the time of the raw, and snapshots that nobody needs; within a transaction.

    The descriptions of machines are few, and stay: whoever looks at a year has to know which one was live at its beginning.
    """
    db.execute(
        """DELETE FROM events WHERE number IN (
            SELECT number FROM events LEFT JOIN machines ON machines.id = events.machine
            WHERE received_ms < ?1 AND (kind != 1 OR from_ms IS NULL)
                AND (events.to_ms IS NULL OR events.to_ms < ?1)
                AND NOT EXISTS (SELECT 1 FROM pins WHERE (pins.machine = machines.name OR events.machine IS NULL)
                    AND events.received_ms BETWEEN pins.from_ms - ?2 AND pins.to_ms + ?2)
            ORDER BY number LIMIT ?3)""",
        (now_ms - round(retention.raw_days * DAY_MS), HOUR_MS, EVENTS_AT_ONCE),
    )
    db.execute(
        """DELETE FROM snapshots WHERE received_ms < ?1 AND processor != 'description' AND EXISTS (
                SELECT 1 FROM snapshots AS other
                WHERE other.processor = snapshots.processor AND other.unit = snapshots.unit
                    AND other.received_ms / 86400000 = snapshots.received_ms / 86400000
                    AND other.received_ms < snapshots.received_ms)
            AND NOT EXISTS (SELECT 1 FROM pins WHERE snapshots.received_ms BETWEEN pins.from_ms - ?2 AND pins.to_ms)""",
        (now_ms - SNAPSHOTS_FULL_DAYS * DAY_MS, 2 * HOUR_MS),
    )
    db.execute(  # those before all messages that are still there
        """DELETE FROM snapshots WHERE received_ms < ?1 AND processor != 'description'
            AND NOT EXISTS (SELECT 1 FROM pins WHERE snapshots.received_ms BETWEEN pins.from_ms - ?2 AND pins.to_ms)""",
        (now_ms - round(retention.raw_days * DAY_MS) - 2 * DAY_MS, DAY_MS),
    )
