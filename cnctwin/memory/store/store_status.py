"""The state of a store, in a few look-ups."""

import json
import sqlite3
from collections.abc import Callable, Iterable
from pathlib import Path

from cnctwin.memory.store.contract import Status
from cnctwin.memory.store.extra import MISSING, extra_is_there
from cnctwin.memory.store.retention import Retention
from cnctwin.memory.store.sealed.manifest import DAY_MS, State
from cnctwin.memory.store.series_table import StoredClass

FREE_BYTES_MIN = 200_000_000
"""Below this the disk counts as full: nothing more is taken, so that what is there can still be tidied and read."""
SPARE_FREE_BYTES = 1_000_000_000
"""Raw is swept before the disk has less than this left."""
_LOOK = """
SELECT (SELECT value FROM meta WHERE name = 'samples'), (SELECT value FROM meta WHERE name = 'file_bytes'),
    (SELECT min(first_us) / 1000 FROM latest), (SELECT max(last_us) / 1000 FROM latest),
    (SELECT (page_count - freelist_count) * page_size FROM pragma_page_count, pragma_freelist_count, pragma_page_size)
"""
_NEW = """
SELECT class, sum(bytes), min(from_ms), max(to_ms) FROM files WHERE state = 0 AND from_ms >= ? GROUP BY class
"""
DAYS_MOST = 36_500.0


def status(
    db: sqlite3.Connection,
    folder: Path,
    retention: Retention | None,
    free_bytes: Callable[[Path], int],
    damaged: Iterable[str],
) -> Status:
    """Raises sqlite3.Error where it cannot be read."""
    samples, sealed, oldest, newest, hot = db.execute(_LOOK).fetchone()
    if retention is None:
        found = db.execute("SELECT value FROM meta WHERE name = 'retention'").fetchone()
        retention = Retention() if found is None else Retention(**json.loads(found[0]))
    trouble = list(damaged)
    aside = [name for (name,) in db.execute("SELECT name FROM files WHERE state = ? LIMIT 3", (int(State.DAMAGED),))]
    trouble += [f"{folder / name}: was damaged, and is set aside" for name in aside]
    if not extra_is_there():
        trouble.append(f"{MISSING}: all stays in SQLite, and nothing is sealed or swept")
    try:
        free = free_bytes(folder)
    except OSError as error:
        return Status(
            samples, sealed + hot, oldest, newest, None, 0, f"{folder}: cannot read the free space of its disk: {error}"
        )
    if free < FREE_BYTES_MIN:
        trouble.append(f"{folder}: the disk has {free // 1_000_000} MB left; nothing more is kept until there is room")
    elif free < SPARE_FREE_BYTES and sealed:
        left, spare = free // 1_000_000, SPARE_FREE_BYTES // 1_000_000
        trouble.append(f"{folder}: the disk has {left} MB left: the oldest raw goes before its time, to keep {spare} MB free")
    used = sealed + hot
    room = used + free if retention.disk_bytes is None else min(used + free, retention.disk_bytes)
    return Status(samples, used, oldest, newest, _days_left(db, newest, used, room, retention), 0, "; ".join(trouble))


def _days_left(db: sqlite3.Connection, newest_ms: int | None, used: int, room: int, retention: Retention) -> float | None:
    """Until raw has to go before its time, at the rate of the last week that was sealed."""
    found = {} if newest_ms is None else {row[0]: row[1:] for row in db.execute(_NEW, (newest_ms - 7 * DAY_MS,))}
    if not found:
        return None
    days = (max(row[2] for row in found.values()) - min(row[1] for row in found.values())) / DAY_MS
    raw, block, twin, rollup = ((found[int(c)][0] if int(c) in found else 0) / days for c in StoredClass)
    swept = raw * retention.raw_days + block * retention.block_days
    a_day = twin + rollup if swept < room - used else raw + block + twin + rollup
    left = room - swept if swept < room - used else room - used
    return round(min(max(left, 0) / a_day, DAYS_MOST), 2) if a_day else DAYS_MOST
