"""The ledger of one edge: received = emitted + dropped(reason) + buffered, in observations.

Where rows are stored, emitted means that a broker has confirmed them; until then they are buffered. What an earlier life of the
edge has left in the store is received again. `queued` is counted by the thread that reads, the rest by the one that publishes; so
at any moment at which the latter is between two documents the equation must hold, and `difference` says by how much it does not.
"""

import threading
from collections.abc import Mapping

from edge.sample import Drop
from sparkplug.datatype import DataType
from sparkplug.metric import Change, MetricSpec
from twin.vocabulary.node_ledger import BUFFERED, DROPPED, DROPPED_PREFIX, EMITTED, RECEIVED


class Ledger:
    """Counters, and the metrics that show them. All of them go into one message."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._received = 0
        self._queued = 0
        self._emitted = 0
        self._dropped = dict.fromkeys(Drop, 0)
        self._held = 0
        self._stored = 0

    def recover(self, stored: int, held: int) -> None:
        """Observations of an earlier life lie in the store, and in the tool change's memory."""
        with self._lock:
            self._received += stored + held
            self._stored, self._held = stored, held

    def queue(self, observations: int) -> None:
        """Observations have been read and wait to be looked at."""
        with self._lock:
            self._received += observations
            self._queued += observations

    def settle(self, *, taken: int, emitted: int, dropped: Mapping[Drop, int], held: int, stored: int = 0) -> None:
        """`taken` observations have left the queue; `held` wait in the tool change's state machine, `stored` in the store."""
        with self._lock:
            self._queued -= taken
            self._emitted += emitted
            for reason, number in dropped.items():
                self._dropped[reason] += number
            self._held, self._stored = held, stored

    def snapshot(self) -> dict[str, int]:
        """All counters by metric name."""
        with self._lock:
            counters = {
                RECEIVED: self._received,
                EMITTED: self._emitted,
                BUFFERED: self._queued + self._held + self._stored,
                DROPPED: sum(self._dropped.values()),
            }
            return counters | {f"{DROPPED_PREFIX}{reason}": number for reason, number in self._dropped.items()}

    @staticmethod
    def difference(counters: Mapping[str, int]) -> int:
        """Return what is missing in a snapshot; anything but 0 is a bug of ours."""
        return counters[RECEIVED] - counters[EMITTED] - counters[DROPPED] - counters[BUFFERED]

    def metrics(self) -> list[MetricSpec]:
        """The counters in the birth certificate."""
        return [MetricSpec(name, DataType.INT64, "observations", value=0) for name in self.snapshot()]

    def changes(self, now_ms: int) -> list[Change]:
        """One consistent snapshot."""
        return [Change(name, number, now_ms) for name, number in self.snapshot().items()]
