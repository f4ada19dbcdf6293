"""The daily load of a store, by what is kept together; from its sealed hours, or from what is still in SQLite."""

from cnctwin.memory.store.contract import StoreError
from cnctwin.memory.store.database import Readers
from cnctwin.memory.store.plan import BLOCK_BYTES, SLOW_BYTES, TWIN_BYTES, Load
from cnctwin.memory.store.sealed.manifest import DAY_MS
from cnctwin.memory.store.series_table import StoredClass

WEEK_MS = 7 * DAY_MS
_SEALED = """
SELECT class, sum(bytes), min(from_ms), max(to_ms), sum(samples), count(DISTINCT machine) FROM files
WHERE state = 0 AND from_ms >= (SELECT max(to_ms) FROM files) - ? GROUP BY class
"""
_HOT = """
SELECT class, sum(samples), (SELECT min(first_us) / 1000 FROM latest), (SELECT max(last_us) / 1000 FROM latest) FROM (
    SELECT series.class AS class, count(*) AS samples FROM samples JOIN series ON series.sid = samples.sid GROUP BY 1
    UNION ALL
    SELECT class, sum(samples) FROM chunks GROUP BY 1)
GROUP BY class
"""


def measured_load(readers: Readers) -> Load:
    """Bytes a day of all machines. Raises StoreError where the store has seen less than a minute."""
    with readers.snapshot() as db:
        sealed = {row[0]: row[1:] for row in db.execute(_SEALED, (WEEK_MS,))}
        hot = {} if sealed else {row[0]: row[1:] for row in db.execute(_HOT)}
        (machines,) = db.execute("SELECT count(*) FROM machines").fetchone()
    if sealed:
        from_ms, to_ms = min(row[1] for row in sealed.values()), max(row[2] for row in sealed.values())
        a_day = {stored_class: row[0] / (to_ms - from_ms) * DAY_MS for stored_class, row in sealed.items()}
        samples = sum(row[3] for row in sealed.values())
        size = sum(row[0] for stored_class, row in sealed.items() if stored_class != StoredClass.ROLLUP) / max(samples, 1)
        basis = f"{_machines(machines)} as measured over {(to_ms - from_ms) / 3_600_000:.0f} h, {size:.2f} bytes a sample"
    elif hot:
        from_ms, to_ms = min(row[1] for row in hot.values()), max(row[2] for row in hot.values())
        if to_ms - from_ms < 60_000:
            raise StoreError("this store has seen less than a minute; give --machines, --signals and --rate-hz")
        each = {StoredClass.RAW: SLOW_BYTES, StoredClass.BLOCK: BLOCK_BYTES * 1000, StoredClass.TWIN: TWIN_BYTES}
        a_day = {c: row[0] / (to_ms - from_ms) * DAY_MS * each[StoredClass(c)] for c, row in hot.items()}
        basis = f"{_machines(machines)} as measured over {(to_ms - from_ms) / 60_000:.0f} min, nothing sealed yet"
    else:
        raise StoreError("this store is empty; give --machines, --signals and --rate-hz")
    raw, blocks, twin, rollup = (a_day.get(int(c), 0.0) for c in StoredClass)
    return Load(raw, blocks, twin, rollup, basis)


def _machines(number: int) -> str:
    return f"{number} machine" + "s" * (number != 1)
