"""Store and forward: rows of one machine on their way from the pipeline to a broker that has confirmed them.

    put ──► ring (on the disk) ──► sent live ──────────┐
                │                                      ├──► barrier ──acknowledged──► deleted, counted as emitted
                └── not sent, or not confirmed ──► sent as history ──┘

Data messages are QoS 0 in Sparkplug, so no broker confirms them. A QoS 1 message that follows them on the same connection (a
barrier) does: a broker takes the packets of a connection in order, and what the barrier follows has been taken with it. What was
sent on a connection that ended before its barrier came back may have arrived or not: it is sent again, as history, with the
`edge_sequence` that it had, by which a reader can tell.

Live rows go out at once, whatever waits. History follows in the order of its numbers, no faster than the configured rate, with
its own time stamps and `is_historical`, and only as far ahead of its confirmation as one second of that rate.

Where a historian is part of the plant (`edge.running.awaited`), what the broker has confirmed stays until it confirms it too
(`edge.running.receipts`).
"""

import json
import logging
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple, Protocol

from edge.config import StoreSection
from edge.errors import StoreError
from edge.place import Place
from edge.running.awaited import Awaited
from edge.running.receipts import RECEIPT, Receipts
from edge.running.ring import Ring, StoredRow
from edge.running.ring_file import Eviction
from edge.running.spans import Spans
from edge.sample import Drop, EdgeSample, observations_of
from sparkplug.actions import HostState
from sparkplug.datatype import DataType
from sparkplug.errors import SparkplugError
from sparkplug.metric import Change, MetricSpec
from sparkplug.quality import Quality

SEQUENCE = "edge_sequence"
BARRIER_ROWS = 500
BARRIER_S = 0.5
HOUSEKEEPING_S = 1.0
READ_AT_ONCE = 100
FLIGHTS_MAX = 500  # what a broker leaves unconfirmed for so many barriers waits again, and can be evicted
EVICTION_S_MAX = 0.05  # in one go: the rows that come meanwhile have to wait
_log = logging.getLogger(__name__)
_ENCODE = json.JSONEncoder(ensure_ascii=False, separators=(",", ":")).encode
_DROPS = {Eviction.AGE: Drop.STORE_AGE, Eviction.BYTES: Drop.STORE_BYTES, Eviction.DISK: Drop.STORE_DISK}


class Sender(Protocol):
    """The part of `sparkplug.edge_node.EdgeNode` that is needed here."""

    def publish(self, device: str | None, changes: Sequence[Change]) -> bool: ...
    def barrier(self, token: int, session: int) -> bool: ...
    @property
    def online(self) -> bool: ...
    @property
    def session(self) -> int: ...


@dataclass(slots=True)
class _Flight:
    """Rows sent in one session, and the barrier behind them (0: not sent yet)."""

    session: int
    token: int = 0
    rows: int = 0
    observations: int = 0
    spans: Spans = field(default_factory=Spans)


class Settled(NamedTuple):
    """Observations that have come to their end since the last time."""

    emitted: int
    dropped: Mapping[Drop, int]


NOTHING_SETTLED = Settled(0, MappingProxyType({}))


class Forwarder:
    """The rows of one device. All methods but `confirmed` are for one thread at a time."""

    def __init__(self, ring: Ring, node: Sender, device: str, limits: StoreSection, clock: Callable[[], float]) -> None:
        self._ring, self._node, self._device, self._limits, self._clock = ring, node, device, limits, clock
        self._waiting = Spans(ring.spans())
        self._flights: deque[_Flight] = deque()
        self._confirmed: deque[int] = deque(maxlen=1_000)
        self._receipts = Receipts()
        self._awaited = Awaited(device, limits.await_receipt, ring.historian(), clock())
        self._kept: deque[tuple[int, int]] = deque()  # by a memory, and to be deleted
        self._token = self._landed = 0
        self._declared: frozenset[str] = frozenset()
        self._budget_rows, self._paid_s = 0.0, clock()
        self._barrier_s = self._kept_s = clock()
        self._place: Place | None = None
        self._memory: str | None = None
        self._emitted, self._dropped = 0, Counter[Drop]()
        self.history_rows = 0
        self.evicted_rows = 0
        self._evicted_first, self.evicted = 0, ""
        self.error = ""

    # What the loop has.

    def place(self) -> Place | None:
        """Return where the control has to be asked next, as stored."""
        return self._ring.place()

    def memory(self) -> str | None:
        """Return the pipeline's memory, as stored."""
        return self._ring.memory()

    def metrics(self) -> Sequence[MetricSpec]:
        """The metrics of its own that a birth has to declare."""
        sequence = MetricSpec(SEQUENCE, DataType.INT64)
        return (sequence, MetricSpec(RECEIPT, DataType.STRING)) if self._awaited.is_possible else (sequence,)

    def declare(self, names: Iterable[str]) -> None:
        """Note what the present birth declares: history of anything else can't be told any more. Empty: the device is dead."""
        self._declared = frozenset(names)

    def put(self, rows: Sequence[Sequence[EdgeSample]], place: Place | None, memory: str | None = None) -> Settled:
        """Store the rows of a frame with the place and the memory after it, then send them. Nothing of it has settled then.

        What a frame without rows has moved is written with the next one, or within a second: a killed edge takes it again.
        """
        self._place, self._memory = place or self._place, memory or self._memory
        if rows:
            self._store(rows)
        return NOTHING_SETTLED

    def _store(self, rows: Sequence[Sequence[EdgeSample]]) -> None:
        try:
            first = self._ring.append([(observations_of(row), _body(row)) for row in rows], self._place, self._memory)
            self._place = self._memory = None
        except StoreError as error:
            self._fail(error)
            for row in rows:
                self._send_unstored(row)
            return
        for sequence, row in enumerate(rows, start=first):
            changes = [sample.change for sample in row]
            self._fly(sequence, observations_of(row), [*changes, Change(SEQUENCE, sequence, changes[-1].timestamp_ms)])

    def confirmed(self, token: int) -> None:
        """The broker has acknowledged a barrier. From any thread."""
        self._confirmed.append(token)

    def receipt(self, text: str) -> None:
        """A memory has written which rows it keeps. From any thread."""
        if self._awaited.is_possible:
            self._receipts.hear(text)

    def host_state(self, host: str, state: HostState | None) -> None:
        """A historian has said whether it is there; None: it is no part of the plant any more. From any thread."""
        self._awaited.hear(host, state)

    def pump(self) -> Settled:
        """Do what is due: take confirmations, send history, set a barrier, keep the ring in its bounds."""
        now_s = self._clock()
        try:
            self._attend()
            self._land(now_s)
            self._history(now_s)
            self._bar(now_s)
            if now_s - self._kept_s >= HOUSEKEEPING_S:
                self._kept_s = now_s
                self._keep_bounds(now_s)
        except StoreError as error:
            self._fail(error)
        if not self._emitted and not self._dropped:
            return NOTHING_SETTLED
        settled = Settled(self._emitted, self._dropped)
        self._emitted, self._dropped = 0, Counter()
        return settled

    def close(self) -> None:
        """Write the place and close the ring; what is unconfirmed stays in it."""
        try:
            self._keep_place()
        except StoreError as error:
            self._fail(error)
        self._ring.close()

    # What it shows.

    @property
    def observations(self) -> int:
        """Return how many are stored, or have come to their end since the last `pump`."""
        return self._ring.observations + self._emitted + self._dropped.total()

    @property
    def is_done(self) -> bool:
        """Return whether all that was sent is confirmed."""
        return not self._flights

    @property
    def is_behind(self) -> bool:
        """Return whether history waits that could be sent now."""
        return bool(self._waiting) and bool(self._declared) and self._node.online

    def health(self) -> dict[str, int | float | str | bool]:
        """Its metrics."""
        return {
            "health/store_rows": self._ring.rows,
            "health/store_waiting_rows": len(self._waiting),
            "health/store_bytes": self._ring.bytes,
            "health/store_age_s": self._ring.age_s,
            "health/store_history_rows": self.history_rows,
            "health/store_evicted_rows": self.evicted_rows,
            "health/store_evicted": self.evicted,
            "health/store_error": self.error,
            **self._awaited.health(self._receipts, self._clock()),
        }

    # How it is done.

    def _fly(self, sequence: int, observations: int, changes: Sequence[Change]) -> bool:
        """Send one message; the row is in flight where it was sent in one session, else it waits."""
        session = self._node.session
        if not self._node.publish(self._device, changes) or session != self._node.session:
            self._waiting.add(sequence, sequence)
            return False
        flight = self._flights[-1] if self._flights else None
        if flight is None or flight.token or flight.session != session:
            self._strand(session)  # so that all flights are of one session, and no barrier confirms what another one took
            flight = _Flight(session)
            self._flights.append(flight)
        flight.spans.add(sequence, sequence)
        flight.rows += 1
        flight.observations += observations
        return True

    def _attend(self) -> None:
        """Note whether there is a historian to wait for; what waited for one that is none any more has come to its end."""
        if self._awaited.settle(self._receipts.heard_s):
            self._ring.keep_historian(self._awaited.host)
        if not self._awaited.host:
            self._kept.extend(self._receipts.release())

    def _land(self, now_s: float) -> None:
        """Finish what was confirmed. Where the disk fails the flight stays, and lands with a later pump."""
        while self._confirmed:
            self._landed = max(self._landed, self._confirmed.popleft())
        while self._flights and 0 < self._flights[0].token <= self._landed:
            flight = self._flights[0]
            if not self._awaited.host:
                *others, final = flight.spans
                for span in others:
                    self._ring.delete(*span, 0)
                self._ring.delete(*final, flight.observations)
                self._emitted += flight.observations
            else:
                self._receipts.wait(flight.spans, now_s)
            self._flights.popleft()
            self.error = ""
        self._strand(self._node.session)
        self._receive(now_s)

    def _receive(self, now_s: float) -> None:
        """Finish what a memory keeps; send again what it has missed."""
        kept, missed = self._receipts.settle(now_s)
        for span in missed:
            self._waiting.add(*span)
        self._kept.extend(kept)
        while self._kept:  # where the disk fails they are forgotten with a later pump
            self._emitted += self._ring.forget(*self._kept[0])
            self._kept.popleft()

    def _strand(self, session: int) -> None:
        """Let wait again what was sent in another session, or is not confirmed for long."""
        while self._flights and (self._flights[0].session != session or len(self._flights) >= FLIGHTS_MAX):
            for first, last in self._flights.popleft().spans:
                self._waiting.add(first, last)

    def _history(self, now_s: float) -> None:
        rate, paid_s = self._limits.history_rows_per_s, self._paid_s
        self._paid_s = now_s
        confirms = len(self._flights) < FLIGHTS_MAX // 2  # else all of it would be sent again and again
        if not self._declared or not self._waiting or not self._node.online or not confirms:
            return
        self._budget_rows = min(self._budget_rows + (now_s - paid_s) * rate, max(rate, 1.0))
        in_flight = sum(flight.rows for flight in self._flights)
        allowed = min(int(self._budget_rows), READ_AT_ONCE, int(rate) + BARRIER_ROWS - in_flight)
        if allowed < 1 or (span := self._waiting.take(allowed)) is None:
            return
        self._budget_rows -= span[1] - span[0] + 1
        try:
            rows = self._ring.read(*span)
        except StoreError:
            self._waiting.add(*span)
            raise
        for row in rows:
            self._tell(row)

    def _tell(self, row: StoredRow) -> None:
        """One row of history. What the device does not declare any more cannot be told, and is counted."""
        try:
            changes = [change for change in _changes(row) if change.name in self._declared]
            if not changes:
                raise StoreError("nothing of it is declared")
            stamp_ms = changes[-1].timestamp_ms
            if self._fly(
                row.sequence, row.observations, [*changes, Change(SEQUENCE, row.sequence, stamp_ms, is_historical=True)]
            ):
                self.history_rows += 1
        except (SparkplugError, StoreError, ValueError, TypeError) as error:
            _log.warning("%s: row %d of the store can no longer be sent: %s", self._ring.file, row.sequence, error)
            self._forget(row)

    def _forget(self, row: StoredRow) -> None:
        try:
            self._ring.delete(row.sequence, row.sequence, row.observations)
        except StoreError as error:
            self._waiting.add(row.sequence, row.sequence)
            self._fail(error)
        else:
            self._dropped[Drop.UNDECLARED] += row.observations

    def _bar(self, now_s: float) -> None:
        """Set a barrier behind what was sent since the last one."""
        flight = self._flights[-1] if self._flights else None
        if flight is None or flight.token:
            return
        if flight.rows >= BARRIER_ROWS or now_s - self._barrier_s >= BARRIER_S:
            self._barrier_s = now_s
            if self._node.barrier(self._token + 1, flight.session):
                self._token += 1
                flight.token = self._token

    def _keep_bounds(self, now_s: float) -> None:
        self._keep_place()
        self._ring.look()
        flying = [first for flight in self._flights for first, _ in flight.spans]
        upto = min(flying, default=self._ring.last + 1) - 1
        while (gone := self._ring.evict(upto)) is not None:
            self._waiting.cut(gone.last)
            self._receipts.cut(gone.last)
            self._dropped[_DROPS[gone.reason]] += gone.observations
            self.evicted_rows += gone.rows
            self._evicted_first = self._evicted_first or gone.first
            self.evicted = f"{self._evicted_first}-{gone.last} {gone.reason}"
            if self._clock() - now_s > EVICTION_S_MAX:
                self._kept_s -= HOUSEKEEPING_S  # goes on at the next turn
                break

    def _keep_place(self) -> None:
        if self._place is not None:
            self._ring.keep(self._place, self._memory)
            self._place = self._memory = None

    def _send_unstored(self, row: Sequence[EdgeSample]) -> None:
        """Send without a store, where the disk takes nothing: what is not sent now is lost, and counted."""
        if self._node.publish(self._device, [sample.change for sample in row]):
            self._emitted += observations_of(row)
        else:
            self._dropped[Drop.BROKER_OFFLINE] += observations_of(row)

    def _fail(self, error: StoreError) -> None:
        if str(error) != self.error:
            _log.warning("%s", error)
        self.error = str(error)


def _body(row: Iterable[EdgeSample]) -> str:
    return _ENCODE([(s.signal, s.value, s.timestamp_ms, int(s.quality), s.reason) for s in row])


def _changes(row: StoredRow) -> list[Change]:
    told = json.loads(row.body)
    return [Change(name, value, stamp, Quality(quality), why, is_historical=True) for name, value, stamp, quality, why in told]
