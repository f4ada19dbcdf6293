"""Puts the messages of one edge node back in order (Sparkplug 3.0.0, 5.7: reorder timeout).

Sequence numbers count to 255 and begin again, so a number tells at most 127 messages ahead from 128 behind. What is ahead is
held until the missing ones come or the timeout ends; what is behind is a duplicate or came too late, unless its time stamp
says that it is new: then the peer counts sloppily (seen in the field), and its data is taken without asking for a rebirth.
"""

from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple

_AHEAD_MAX = 127
_REPEAT_MAX = 16
_ANY = -1


class Numbered(NamedTuple):
    """A message with its sequence number and the time stamp of its payload (0 where it has none)."""

    seq: int
    timestamp_ms: int
    message: Any


class Verdict(Enum):
    """The verdict on a message."""

    TAKEN = "taken"
    HELD = "held"
    LATE = "late or duplicate"
    SLOPPY = "taken in spite of its sequence number"


class Delivery(NamedTuple):
    """The messages that are in order now, and how many before them are missing for good."""

    messages: tuple[Numbered, ...]
    lost: int
    verdict: Verdict


@dataclass(slots=True)
class SequenceWindow:
    """The order of one node's messages since its birth."""

    reorder_timeout_ms: int
    _expected: int = 0
    _newest_ms: int = 0
    _held: dict[int, Numbered] = field(default_factory=dict)
    _waiting_since_ms: int | None = None

    def begin(self, seq: int, timestamp_ms: int) -> int:
        """A birth has come with this number; hands back how many messages before it are missing for good."""
        lost = self._missing()
        self._expected, self._newest_ms = (seq + 1) % 256, timestamp_ms
        self._held.clear()
        self._waiting_since_ms = None
        return lost

    def is_next(self, seq: int, timestamp_ms: int) -> bool:
        """Return whether a message is simply the next one and nothing is held: then it is noted, and needs no `take`."""
        if seq != self._expected or self._held:
            return False
        self._expected = (seq + 1) % 256
        self._newest_ms = max(self._newest_ms, timestamp_ms)
        return True

    def skip(self) -> None:
        """Messages were left out on purpose: the next one, whatever its number, begins a new count."""
        self._held.clear()
        self._waiting_since_ms = None
        self._expected = _ANY

    def take(self, numbered: Numbered, now_ms: int) -> Delivery:
        """Take a message; what is in order comes back at once."""
        if self._expected == _ANY:
            self._expected = numbered.seq % 256
        ahead = (numbered.seq - self._expected) % 256
        if ahead == 0:
            return self._run((numbered,), 0, Verdict.TAKEN)
        if ahead <= _AHEAD_MAX:
            if numbered.seq in self._held:
                return Delivery((), 0, Verdict.LATE)
            self._held[numbered.seq] = numbered
            if self._waiting_since_ms is None:
                self._waiting_since_ms = now_ms
            return Delivery((), 0, Verdict.HELD)
        if numbered.timestamp_ms <= self._newest_ms:
            return Delivery((), 0, Verdict.LATE)
        repeated = 256 - ahead <= _REPEAT_MAX
        lost = self._missing() if repeated else ahead
        self._held.clear()
        self._waiting_since_ms = None
        return self._run((numbered,), lost, Verdict.SLOPPY if repeated else Verdict.TAKEN)

    def expire(self, now_ms: int) -> Delivery | None:
        """Return what is delivered although messages before it are missing, once the timeout is over."""
        if self._waiting_since_ms is None or now_ms - self._waiting_since_ms < self.reorder_timeout_ms:
            return None
        return self.flush()

    def flush(self) -> Delivery:
        """Give up waiting: everything held, in order."""
        lost = self._missing()
        held = tuple(sorted(self._held.values(), key=lambda n: (n.seq - self._expected) % 256))
        self._held.clear()
        self._waiting_since_ms = None
        return self._run(held, lost, Verdict.TAKEN) if held else Delivery((), lost, Verdict.TAKEN)

    def _missing(self) -> int:
        """Return how many numbers between the expected one and the last held one never came."""
        if not self._held:
            return 0
        return max((seq - self._expected) % 256 for seq in self._held) + 1 - len(self._held)

    def _run(self, messages: tuple[Numbered, ...], lost: int, verdict: Verdict) -> Delivery:
        """Deliver, and with it what was held for just this moment."""
        self._expected = (messages[-1].seq + 1) % 256
        if self._held:
            more = list(messages)
            while (follower := self._held.pop(self._expected, None)) is not None:
                more.append(follower)
                self._expected = (self._expected + 1) % 256
            messages = tuple(more)
            if not self._held:
                self._waiting_since_ms = None
        self._newest_ms = max(self._newest_ms, messages[-1].timestamp_ms)
        return Delivery(messages, lost, verdict)
