"""A process that keeps things, and says on stdout what is safe now: `python -m … WHAT FOLDER`."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from cnctwin.memory.parts.journal import Journal
from cnctwin.memory.store.embedded import EmbeddedStore
from cnctwin.memory.store.influx.spool import Batch, RingLimits, Spool
from cnctwin.memory.store.sealed.manifest import DAY_MS
from tests.cnctwin.memory.store.told import T0_MS, steady

BATCHES, MESSAGES = 4, 50


def appended(folder: Path) -> Iterator[int]:
    """Messages in a store."""
    store = EmbeddedStore(folder / "deep" / "store", writable=True, free_bytes=lambda _: 10**12)
    for batch in range(BATCHES):
        store.append(steady(batch * MESSAGES * 100, MESSAGES, start=batch * MESSAGES))
        yield (batch + 1) * MESSAGES


def sealed(folder: Path) -> Iterator[int]:
    """A day of a store that leaves SQLite for Parquet, again and again."""
    store = EmbeddedStore(folder / "deep" / "store", writable=True, free_bytes=lambda _: 10**12)
    for batch in range(BATCHES):
        store.append(steady(batch * DAY_MS, MESSAGES, start=batch * MESSAGES))
        store.tidy(T0_MS + (batch + 3) * DAY_MS)
        yield (batch + 1) * MESSAGES


def spooled(folder: Path) -> Iterator[int]:
    """Batches before a server."""
    spool = Spool(folder / "deep", RingLimits(), wall_ms=lambda: 0, free_bytes=lambda _: 10**12)
    for batch in range(BATCHES):
        spool.put([Batch("raw", MESSAGES, 0, b"line" * batch)])
        yield (batch + 1) * MESSAGES


def delivered(folder: Path) -> Iterator[int]:
    """Parts that a receiver has taken."""
    journal = Journal(folder / "deep" / "mes.json")
    journal.begin(0)
    for part in range(BATCHES):
        journal.settle("vmc", f"part-{part}", part, "delivered")
        yield part + 1


if __name__ == "__main__":
    for safe in {"appended": appended, "sealed": sealed, "spooled": spooled, "delivered": delivered}[sys.argv[1]](
        Path(sys.argv[2])
    ):
        os.write(1, f"{safe}\n".encode())
    os._exit(0)
