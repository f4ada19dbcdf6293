"""An embedded store of the last days and a server for the years, written together and asked as one.

Messages, snapshots and what was last come from the embedded one, so that a replay works, and the page lives without the server.
A question about times goes to the embedded store for the last hour (or as far back as samples wait for the server), to the server
for what lies before, and is put together at the border of a window. What the server has nothing of, or where it is away, the
embedded store is asked too.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Protocol

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
    Store,
    StoreError,
    Tidied,
)

FRESH_MS = 3_600_000
UNPINNED_MAX = 1_000


class WaitingStore(Store, Protocol):
    """A store on a server, which knows since when samples wait for it."""

    def oldest_waiting_ms(self) -> int | None:
        """The time of the oldest sample that waits for the server; None where none does."""


class Both:
    """The embedded store is the one that must not fail; what the server's ring cannot take is said in `status`."""

    def __init__(self, embedded: Store, server: WaitingStore) -> None:
        self._embedded, self._server = embedded, server
        self._trouble, self._lost = "", 0
        self._unpinned: list[Pinned] = []

    def append(self, messages: Sequence[Message]) -> Appended:
        """Keep messages in both; the account is the embedded store's."""
        appended = self._embedded.append(messages)
        try:
            self._server.append(messages)
            self._trouble = ""
        except StoreError as error:
            self._trouble = str(error)
            self._lost += sum(len(message.event.readings) for message in messages)
        return appended

    def pin(self, pinned: Pinned) -> None:
        """Keep a stretch in both; what the server's ring cannot take now it is given with the next `tidy`."""
        self._embedded.pin(pinned)
        try:
            self._server.pin(pinned)
        except StoreError as error:
            self._trouble = str(error)
            self._unpinned = [*self._unpinned[1 - UNPINNED_MAX :], pinned]

    def pins(self, machine: str | None = None) -> list[Pinned]:
        """All pins, oldest first."""
        return self._embedded.pins(machine)

    def keep_snapshot(self, *snapshots: Snapshot) -> None:
        """Keep snapshots in the embedded store."""
        self._embedded.keep_snapshot(*snapshots)

    def snapshot_before(self, processor: str, unit: str, at_ms: int) -> Snapshot | None:
        """The last snapshot that was received before a moment."""
        return self._embedded.snapshot_before(processor, unit, at_ms)

    def machines(self) -> list[str]:
        """All machines, by name; of the embedded store only where the server is away."""
        found = set(self._embedded.machines())
        with suppress(StoreError):
            found |= set(self._server.machines())
        return sorted(found)

    def series(self, machine: str) -> list[Series]:
        """The signals of a machine, by name; since when, the server tells, where it is there."""
        found = {(series.signal, series.node): series for series in self._embedded.series(machine)}
        with suppress(StoreError):
            for series in self._server.series(machine):
                known = found.get((series.signal, series.node), series)
                first_us, last_us = min(known.first_us, series.first_us), max(known.last_us, series.last_us)
                found[series.signal, series.node] = known._replace(first_us=first_us, last_us=last_us)
        return [found[place] for place in sorted(found)]

    def latest(self, machine: str) -> dict[str, Sample]:
        """The last sample of each signal; the server is asked for a machine that the embedded store does not know (any more)."""
        return self._embedded.latest(machine) or self._server.latest(machine)

    def query(self, query: Query) -> list[Column]:
        """A column for each signal asked for, in that order."""
        border_ms = self._border_ms(query.every_ms or 1)
        if query.from_ms >= border_ms:
            return self._embedded.query(query)
        if query.to_ms <= border_ms:
            return self._before(query)
        before = self._before(Query(query.machine, query.signals, query.from_ms, border_ms, query.every_ms))
        since = self._embedded.query(Query(query.machine, query.signals, border_ms, query.to_ms, query.every_ms))
        return [_joined(first, second) for first, second in zip(before, since, strict=True)]

    def _before(self, query: Query) -> list[Column]:
        """Return the server's answer; of what it does not keep (arrays, long texts, stamps beyond its retention), and where it is
        away, what the embedded store has."""
        try:
            found = self._server.query(query)
        except StoreError:
            return self._embedded.query(query)
        missing = tuple(dict.fromkeys(column.signal for column in found if not column.t_us))
        if not missing:
            return found
        beside = self._embedded.query(Query(query.machine, missing, query.from_ms, query.to_ms, query.every_ms))
        of = {column.signal: column for column in beside}
        return [column if column.t_us else of[column.signal] for column in found]

    def _border_ms(self, every_ms: int) -> int:
        newest_ms = self._embedded.status().newest_ms
        if newest_ms is None:
            return 2**62
        border_ms = newest_ms - FRESH_MS
        waiting_ms = self._server.oldest_waiting_ms()
        if waiting_ms is not None:
            border_ms = min(border_ms, waiting_ms)
        return border_ms // every_ms * every_ms

    def messages(self, machine: str, from_ms: int, to_ms: int) -> Iterator[Message]:
        """Yield the messages of a machine, as far back as the embedded store goes."""
        return self._embedded.messages(machine, from_ms, to_ms)

    def tidy(self, now_ms: int) -> Tidied:
        """Tidy both."""
        unpinned, self._unpinned = self._unpinned, []
        for pinned in unpinned:
            self.pin(pinned)
        one, other = self._embedded.tidy(now_ms), self._server.tidy(now_ms)
        return Tidied(*(first + second for first, second in zip(one, other, strict=True)))

    def status(self) -> Status:
        """That of the embedded store, with what waits for the server and what is wrong there."""
        embedded, server = self._embedded.status(), self._server.status()
        lost = f"{self._lost} samples did not come into the server's ring since the start" if self._lost else ""
        troubles = [trouble for trouble in (embedded.trouble, self._trouble, lost, server.trouble) if trouble]
        return Status(
            embedded.samples,
            embedded.bytes + server.bytes,
            embedded.oldest_ms,
            embedded.newest_ms,
            embedded.days_left,
            embedded.waiting + server.waiting,
            "; ".join(troubles),
        )

    def close(self) -> None:
        """Close both."""
        try:
            self._embedded.close()
        finally:
            self._server.close()


def _joined(first: Column, second: Column) -> Column:
    return Column(
        second.signal,
        second.unit or first.unit,
        first.t_us + second.t_us,
        first.value + second.value,
        first.quality + second.quality,
        first.reason + second.reason,
        first.low + second.low,
        first.high + second.high,
        first.count + second.count,
    )
