"""The account of each block that was asked for: asked = answered + refused, at any time; and of the clients."""

import threading
from collections import Counter


class ServerLedger:
    """Counts of one server, over all its restarts; safe from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counts: Counter[str] = Counter()

    def count(self, *names: str) -> None:
        """Count one of each of these."""
        with self._lock:
            self._counts.update(names)

    def __getitem__(self, name: str) -> int:
        with self._lock:
            return self._counts[name]

    @property
    def balances(self) -> bool:
        """True if each block asked for was answered or refused."""
        with self._lock:
            return self._counts["asked"] == self._counts["answered"] + self._counts["refused"]

    def as_dict(self) -> dict[str, int]:
        """The counts by name; `refused/<code>` and `refused/write` are parts of `refused`."""
        first = ("connections", "frames", "asked", "answered", "refused")
        with self._lock:
            return {name: self._counts[name] for name in first} | {name: self._counts[name] for name in sorted(self._counts)}
