"""The rows of edges that the store has, by their number (`edge_sequence`): what edges are told, and what is missing.

A number stands for one row for ever, so a number between two that the store has, and that does not come, is a hole. An edge that
replays fills holes from below; one that nothing fills for `hole_s` stays, and is named until the row comes or a week has passed:

>>> hole_text(Hole("okuma", 372, 441, 1_772_438_400_000))
'okuma: 372–441 missing since 2026-03-02 08:00 UTC'
"""

import json
import threading
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any, NamedTuple

from cnctwin.memory.store.contract import Message, Store
from edge.running.forwarder import SEQUENCE
from edge.running.receipts import RECEIPT
from edge.running.spans import Spans
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.topics import NodeId

HOLE_S = 60.0
HOLE_KEPT_MS = 7 * 86_400_000
JUMP_MAX = 100_000_000
"""Numbers further ahead are those of an edge whose store was damaged, and began again."""
DEVICES_MAX = 1_000
SPAN_LENGTH_MAX = 40
SPANS_MAX, DUE_SPANS_MAX = 200, 10_000
NAMED_MAX = 3
SAVED_AS = "store", "edge_sequence"
"""The numbers lie in the store like a snapshot of this processor and unit."""
EVICTED = "health/store_evicted"
_DATA, _BIRTH = EventKind.DATA, EventKind.BIRTH


class Hole(NamedTuple):
    """Rows of a machine that the store lacks, since when, and why where its edge has told."""

    machine: str
    first: int
    last: int
    since_ms: int
    why: str = ""


@dataclass(slots=True)
class _Rows:
    """The rows of one device. opened_ms: when the row behind a hole came, by the last number of the hole."""

    is_awaiting: bool = False
    have: Spans = field(default_factory=Spans)
    due: Spans = field(default_factory=Spans)
    newest: int = -1
    live: int = -1
    filled_ms: int = 0
    opened_ms: dict[int, int] = field(default_factory=dict)

    def note(self, number: int, received_ms: int, *, is_live: bool) -> None:
        """A row has been stored."""
        if is_live:
            is_back = number < self.live and number not in self.have  # else it is read again, at a start
            if is_back or (self.live >= 0 and number - self.live > JUMP_MAX):
                self.have, self.opened_ms, self.newest = Spans(), {}, -1  # the edge has begun to count again
            self.live = number
        if number > self.newest:
            if self.newest >= 0 and number > self.newest + 1:
                self.opened_ms[number - 1] = received_ms
            self.newest = number
        else:
            self.filled_ms = received_ms
        self.have.include(number, number)
        if self.is_awaiting:
            self.due.include(number, number)

    def bound(self) -> None:
        """Let go of the oldest holes where there are too many of them."""
        spans = list(self.have)
        if len(spans) > SPANS_MAX:
            *_, kept = spans[: len(spans) - SPANS_MAX + 1]
            self.have = Spans([(spans[0][0], kept[1]), *spans[len(spans) - SPANS_MAX + 1 :]])
        lasts = {b - 1 for _, (b, _) in pairwise(self.have)}
        self.opened_ms = {last: ms for last, ms in self.opened_ms.items() if last in lasts}
        if len(list(self.due)) > DUE_SPANS_MAX:
            self.due = Spans()  # its edge tells them again

    def holes(self) -> Iterable[tuple[int, int, int]]:
        """First, last and since when, oldest first."""
        opened = sorted(self.opened_ms.items())
        for (_, before), (after, _) in pairwise(self.have):
            # A hole that was filled in its middle is two, both as old as it was.
            at = bisect_left(opened, (after - 1, 0))
            yield before + 1, after - 1, opened[at][1] if at < len(opened) else 0


class RowNumbers:
    """The rows of all devices that number them. `note` is for the thread that writes the store, the rest for any."""

    def __init__(self, hole_s: float = HOLE_S) -> None:
        self._hole_ms = round(hole_s * 1000)
        self._rows: dict[tuple[NodeId, str], _Rows] = {}
        self._evicted: dict[NodeId, tuple[int, int, str]] = {}
        self._lock = threading.Lock()
        self.noted_ms = 0
        self.is_changed = False

    def note(self, messages: Sequence[Message]) -> None:
        """Note what the store has taken. A birth says which devices number their rows; it shows the state after a row, not it."""
        with self._lock:
            rows = self._rows
            for received_ms, event in messages:
                kind, node, device, _, readings = event[:5]
                if device is None:
                    self._note_node(event)
                elif kind is _DATA:
                    of_device = rows.get((node, device))
                    if of_device is None:
                        continue
                    reading = next((one for one in reversed(readings) if one[0] == SEQUENCE), None)
                    if reading is not None and type(reading.value) is int:
                        of_device.note(reading.value, received_ms, is_live=not reading.is_historical)
                        self.is_changed = True
                elif kind is _BIRTH:
                    self._note_birth((node, device), {reading.name for reading in readings})
            if messages:
                self.noted_ms = max(self.noted_ms, messages[-1].received_ms)

    def _note_birth(self, key: tuple[NodeId, str], names: set[str]) -> None:
        if not names & {SEQUENCE, RECEIPT}:
            return
        if key not in self._rows and len(self._rows) >= DEVICES_MAX:
            del self._rows[next(iter(self._rows))]
        of_device = self._rows.setdefault(key, _Rows())
        of_device.is_awaiting = RECEIPT in names
        of_device.bound()

    def _note_node(self, event: HostEvent) -> None:
        """An edge tells which rows its own limits have taken."""
        told = next((reading.value for reading in event.readings if reading.name == EVICTED), None)
        span, _, why = told.partition(" ") if isinstance(told, str) else ("", "", "")
        first, _, last = span.partition("-")
        is_known = event.node in self._evicted or len(self._evicted) < DEVICES_MAX
        if is_known and first.isdecimal() and last.isdecimal() and len(span) < SPAN_LENGTH_MAX:
            self._evicted[event.node] = int(first), int(last), why[:20]

    def receipts(self, *, with_silent: bool) -> list[tuple[NodeId, str, str]]:
        """Node, device and the rows stored since this was last asked, of each that waits.

        with_silent: also of those of which none were
        """
        with self._lock:
            told: list[tuple[NodeId, str, str]] = []
            for (node, device), rows in self._rows.items():
                if rows.is_awaiting and (rows.due or with_silent):
                    told.append((node, device, " ".join(f"{a}-{b}" for a, b in rows.due)))
                    rows.due = Spans()
            return told

    def holes(self, now_ms: int) -> list[Hole]:
        """The holes that stay, newest first."""
        with self._lock:
            found: list[Hole] = []
            for (node, device), rows in self._rows.items():
                first, last, why = self._evicted.get(node, (0, -1, ""))
                for a, b, since_ms in rows.holes():
                    if now_ms - HOLE_KEPT_MS < since_ms <= now_ms - self._hole_ms and rows.filled_ms <= now_ms - self._hole_ms:
                        limit = f"the edge's store passed its limit: {why}" if first <= a and b <= last else ""
                        found.append(Hole(device, a, b, since_ms, limit))
        return sorted(found, key=lambda hole: (-hole.since_ms, hole))

    # Over restarts.

    def saved(self) -> bytes:
        """Everything but what is due, to go on from."""
        with self._lock:
            self.is_changed = False
            devices = []
            for (node, device), rows in self._rows.items():
                rows.bound()
                opened = list(rows.opened_ms.items())
                devices.append([node.group, node.node, device, list(rows.have), rows.live, rows.filled_ms, opened])
            return json.dumps({"noted_ms": self.noted_ms, "devices": devices}, separators=(",", ":")).encode()

    def restore(self, saved: bytes) -> None:
        """Go on from what was saved; what cannot be read is begun again."""
        try:
            told: dict[str, Any] = json.loads(saved)
            rows = {
                (NodeId(group, node), device): _Rows(
                    have=Spans([(int(a), int(b)) for a, b in have]),
                    newest=max((int(b) for _, b in have), default=-1),
                    live=int(live),
                    filled_ms=int(filled_ms),
                    opened_ms={int(last): int(ms) for last, ms in opened},
                )
                for group, node, device, have, live, filled_ms, opened in told["devices"]
            }
            noted_ms = int(told["noted_ms"])
        except (ValueError, TypeError, KeyError):
            return
        with self._lock:
            self._rows, self.noted_ms = rows, noted_ms

    def forget(self, machine: str) -> None:
        """The numbers of a machine are begun again."""
        with self._lock:
            self._rows = {key: rows for key, rows in self._rows.items() if key[1] != machine}


def saved_holes(store: Store, now_ms: int) -> list[Hole]:
    """Return the holes of a store as its historian saved them last, also those that history may yet fill."""
    saved = store.snapshot_before(*SAVED_AS, 1 << 62)
    numbers = RowNumbers(hole_s=0.0)
    if saved is not None:
        numbers.restore(saved.payload)
    return numbers.holes(now_ms)


def hole_text(hole: Hole) -> str:
    """Return what a person is told of a hole."""
    since = datetime.fromtimestamp(hole.since_ms / 1000, UTC)
    span = f"{hole.first}–{hole.last}" if hole.last > hole.first else f"{hole.first}"
    return f"{hole.machine}: {span} missing since {since:%Y-%m-%d %H:%M} UTC" + (f" ({hole.why})" if hole.why else "")


def holes_text(holes: Sequence[Hole]) -> str:
    """Return the newest holes in one line; empty where there are none."""
    more = len(holes) - NAMED_MAX
    return "; ".join(map(hole_text, holes[:NAMED_MAX])) + (f"; and {more} more" if more > 0 else "")
