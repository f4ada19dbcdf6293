"""A store on a server: samples only, asked for there, and written through a ring on the disk.

It keeps no messages and no snapshots: a replay needs an embedded store, which `also=<folder>` keeps beside it (`both`).
"""

import logging
import sqlite3
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from pathlib import Path
from random import Random
from typing import Any, NoReturn, Protocol

from cnctwin.memory.store.contract import (
    Appended,
    Column,
    Message,
    Pinned,
    Query,
    Sample,
    Series,
    Snapshot,
    Status,
    StoreError,
    Tidied,
    merged,
)
from cnctwin.memory.store.influx.columns import Answered, columns
from cnctwin.memory.store.influx.intake import Intake
from cnctwin.memory.store.influx.pins import PINS, Pins
from cnctwin.memory.store.influx.sample_row import SampleRow
from cnctwin.memory.store.influx.sender import Patience, Sender
from cnctwin.memory.store.influx.server import Server
from cnctwin.memory.store.influx.spool import FILE, RingLimits, Spool
from cnctwin.memory.store.influx.vocabulary import Vocabulary

DRAINED_S_MAX = 5.0
_log = logging.getLogger(__name__)


class Reader(Protocol):
    """Questions to a server; any thread. Raises StoreError."""

    def machines(self) -> list[str]: ...
    def series(self, machine: str) -> list[Series]: ...
    def latest(self, machine: str) -> dict[str, Sample]: ...
    def samples(self, machine: str, measurement: str, from_ms: int, to_ms: int) -> list[SampleRow]: ...
    def answer(self, query: Query) -> Answered: ...
    def close(self) -> None: ...


def steady_wall_ms() -> Callable[[], int]:
    """ms since 1970, asked once: the wall's clock may be set while we run (a gateway without a battery starts in 1970), and
    nothing is to be thrown away for that."""
    began_ms, began_s = time.time_ns() // 1_000_000, time.monotonic()
    return lambda: began_ms + round((time.monotonic() - began_s) * 1000)


class ReadOnlyServer:
    """A reader's view of a store on a server; `folder` is that of the writer's ring, where that is on the same machine."""

    def __init__(self, reader: Reader, where: str, folder: Path) -> None:
        self._reader, self._where, self._folder = reader, where, folder

    def machines(self) -> list[str]:
        """All machines, by name."""
        return self._reader.machines()

    def series(self, machine: str) -> list[Series]:
        """The signals of a machine, by name."""
        return self._reader.series(machine)

    def latest(self, machine: str) -> dict[str, Sample]:
        """The last sample of each signal."""
        return self._reader.latest(machine)

    def query(self, query: Query) -> list[Column]:
        """A column for each signal asked for, in that order."""
        return columns(query, self._reader.answer(query))

    def messages(self, machine: str, from_ms: int, to_ms: int) -> Iterator[Message]:
        """Raises StoreError: a server keeps samples."""
        raise StoreError(
            f"{self._where}: a server keeps samples, no messages, so nothing can be replayed from it; "
            "keep an embedded store beside it: add also=<folder> to its URL"
        )

    def snapshot_before(self, processor: str, unit: str, at_ms: int) -> Snapshot | None:
        """None: a snapshot is where a replay begins, and there is none from here."""
        return None

    def pins(self, machine: str | None = None) -> list[Pinned]:
        """Return the pins that the writer on this machine has set, as `merged` has them; none where it runs elsewhere."""
        return merged(Pinned(*row) for row in self._ring(PINS, (machine,)))

    def oldest_waiting_ms(self) -> int | None:
        """The time of the oldest sample that waits for the server; None where none does."""
        found = self._ring("SELECT min(oldest_ms) FROM rows", ())
        return None if not found or found[0][0] is None else int(found[0][0])

    def status(self) -> Status:
        """Return the state of the store, as far as the ring tells."""
        found = self._ring("SELECT coalesce(sum(samples), 0), coalesce(sum(bytes), 0) FROM rows", ())
        waiting, size = (int(found[0][0]), int(found[0][1])) if found else (0, 0)
        sent = self._ring("SELECT samples FROM account WHERE name = 'sent'", ())
        return Status(int(sent[0][0]) if sent else 0, size, None, None, None, waiting, "")

    def append(self, messages: Sequence[Message]) -> Appended:
        """Raises StoreError: opened for reading."""
        self._refuse()

    def pin(self, pinned: Pinned) -> None:
        """Raises StoreError: opened for reading."""
        self._refuse()

    def keep_snapshot(self, *snapshots: Snapshot) -> None:
        """Raises StoreError: opened for reading."""
        self._refuse()

    def tidy(self, now_ms: int) -> Tidied:
        """Raises StoreError: opened for reading."""
        self._refuse()

    def close(self) -> None:
        """Close the connections."""
        self._reader.close()

    def _refuse(self) -> NoReturn:
        raise StoreError(f"{self._where}: opened for reading only; the historian writes")

    def _ring(self, text: str, values: tuple[str | None, ...]) -> list[tuple[Any, ...]]:
        file = self._folder / FILE
        if not file.exists():
            return []
        try:
            with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro", uri=True, timeout=2.0)) as db:
                return db.execute(text, values).fetchall()
        except sqlite3.Error as error:
            raise StoreError(f"{file}: cannot be read: {error}") from error


class ServerStore(ReadOnlyServer):
    """The writer. knows_texts: the server keeps texts, and has buckets."""

    def __init__(
        self,
        server: Server,
        reader: Reader,
        where: str,
        folder: Path,
        *,
        knows_texts: bool,
        limits: RingLimits | None = None,
        wall_ms: Callable[[], int] | None = None,
        clock: Callable[[], float] = time.monotonic,
        chance: Random | None = None,
        patience: Patience | None = None,
    ) -> None:
        super().__init__(reader, where, folder)
        self._server, self._knows_texts = server, knows_texts
        self._spool = Spool(folder, limits or RingLimits(), wall_ms=wall_ms or steady_wall_ms())
        self._pins = Pins(self._spool)
        self._complaint = ""
        vocabulary = None if knows_texts else Vocabulary(self._spool)
        self._intake = Intake(self._spool, self._pins, vocabulary, self._complain)
        self._sender = Sender(
            self._spool,
            server,
            clock=clock,
            chance=chance or Random(),  # noqa: S311 — jitter, no secret
            patience=patience,
        )
        self._newest_ms: int | None = None
        self._sender.start()

    def append(self, messages: Sequence[Message]) -> Appended:
        """Put the samples of messages into the ring; the sender takes them from there."""
        appended = self._intake.append(messages)
        for message in messages:
            self._newest_ms = max(self._newest_ms or 0, message.event.timestamp_ms)
        self._sender.wake()
        return appended

    def pin(self, pinned: Pinned) -> None:
        """Keep a stretch: its samples go to the bucket `cnc_pinned` too. VictoriaMetrics has no such place: see `status`."""
        self._pins.add(pinned)

    def pins(self, machine: str | None = None) -> list[Pinned]:
        """Return all pins, oldest first; those of a machine that overlap are one, with all their reasons."""
        return self._pins.all(machine)

    def keep_snapshot(self, *snapshots: Snapshot) -> None:
        """Not kept: without messages there is no replay that would begin there."""

    def oldest_waiting_ms(self) -> int | None:
        """The time of the oldest sample that waits for the server; None where none does."""
        oldest = self._spool.ask("SELECT min(oldest_ms) FROM rows WHERE sequence > ?", (self._sender.passed,))[0][0]
        return None if oldest is None else int(oldest)

    def tidy(self, now_ms: int) -> Tidied:
        """Let go what waits too long, forget old stamps, copy pinned stretches. The server sweeps its buckets itself."""
        before = self._spool.bytes
        self._spool.sweep()
        self._intake.prune()
        pinned = 0
        if self._knows_texts:
            with suppress(StoreError):  # the server is away: next minute
                pinned = self._pins.copy(self._reader.samples, self._sender.passed, now_ms)
            self._sender.wake()
        return Tidied(0, 0, max(before - self._spool.bytes, 0), pinned)

    def account(self) -> dict[str, int]:
        """Samples: taken = sent + refused by the server + evicted + held; beside them those that never came into the ring."""
        return self._spool.account()

    def drain(self, timeout_s: float) -> bool:
        """Wait until the server has acknowledged all that was appended."""
        return self._sender.drain(timeout_s)

    def status(self) -> Status:
        """Return the state of the store: `samples` that the server has, `bytes` of the ring, samples that wait for the server."""
        account = self._spool.account()
        evicted = ", ".join(f"{n} samples lost ({name})" for name, n in account.items() if name.startswith("evicted") and n)
        pins = (
            ""
            if self._knows_texts or not self._pins.all()
            else "pins cannot outlive this server's retention: see docs/how-to/influx.md"
        )
        troubles = [self._sender.trouble, evicted, self._sender.refused, self._complaint, pins]
        return Status(
            account.get("sent", 0),
            self._spool.bytes,
            None,
            self._newest_ms,
            None,
            self._sender.waiting,
            "; ".join(trouble for trouble in troubles if trouble),
        )

    def close(self) -> None:
        """Hand over what waits, for some seconds at most, and close; the rest stays in the ring."""
        if not self._sender.trouble:
            self._sender.drain(DRAINED_S_MAX)
        self._sender.stop()
        self._server.close()
        self._reader.close()
        self._spool.close()

    def _complain(self, text: str) -> None:
        if not self._complaint:
            self._complaint = f"not kept: {text}"
            _log.warning("%s: %s; more of it is only counted", self._where, self._complaint)
