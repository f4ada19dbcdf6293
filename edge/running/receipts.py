"""Rows that the broker has taken, until a memory says that it keeps them.

A broker's acknowledgement says that the broker has a row; who was not subscribed at that moment has missed it. Where an edge
waits for receipts (`edge.running.awaited`), it forgets a row only when a host has written the row's number to the device's
metric `RECEIPT`:

>>> spans_of("1-40 43 45-46")
[(1, 40), (43, 43), (45, 46)]

What no receipt names, while others come (an empty one says that somebody is there), is told again as history. While none come
nobody is there to miss a row, and it waits.
"""

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from edge.running.spans import Spans

RECEIPT = "Device Control/Receipt"
REPEAT_S = 5.0
HEARD_MAX = 1_000
SPANS_MAX = 10_000
DIGITS_MAX = 18


class Settled(NamedTuple):
    """Spans that are kept by a memory, and spans that it has missed."""

    kept: list[tuple[int, int]]
    missed: list[tuple[int, int]]


class Receipts:
    """All methods but `hear` are for one thread at a time."""

    def __init__(self) -> None:
        self._heard: deque[str] = deque(maxlen=HEARD_MAX)
        self._early = Spans()  # named by a receipt before the broker acknowledged them
        self._waiting: deque[tuple[float, Spans]] = deque()  # since when
        self._heard_s = -math.inf

    def hear(self, text: str) -> None:
        """A host has written a receipt. From any thread."""
        self._heard.append(text)

    def wait(self, spans: Sequence[tuple[int, int]] | Spans, now_s: float) -> None:
        """The broker has these; a receipt is awaited from now on."""
        awaited = Spans(spans)
        if (
            self._waiting and now_s >= self._heard_s + REPEAT_S
        ):  # nobody is there; a day of that is one entry, not a hundred thousand
            _, awaited = self._waiting.pop()
            for span in spans:
                awaited.add(*span)
        self._waiting.append((now_s, awaited))

    def cut(self, upto: int) -> None:
        """Rows up to this one are gone."""
        self._early.cut(upto)
        for _, spans in self._waiting:
            spans.cut(upto)

    def release(self) -> list[tuple[int, int]]:
        """Nobody is waited for any more: return all that the broker has, and forget it."""
        released = [span for _, spans in self._waiting for span in spans]
        self._waiting.clear()
        return released

    @property
    def rows(self) -> int:
        """Return how many rows wait."""
        return sum(len(spans) for _, spans in self._waiting)

    @property
    def heard_s(self) -> float:
        """Return when the last receipt came; minus infinity where none has."""
        return self._heard_s

    def settle(self, now_s: float) -> Settled:
        """Return what has come to its end since the last time."""
        while self._heard:
            self._heard_s = now_s
            for first, last in spans_of(self._heard.popleft()):
                self._early.discard(first, last)
                self._early.add(first, last)
        kept = [part for _, spans in self._waiting for part in _both(spans, self._early)]
        while len(list(self._early)) > SPANS_MAX:  # what is named twice is never awaited again
            self._early.take(1 << 62)
        while self._waiting and not self._waiting[0][1]:
            self._waiting.popleft()
        missed: list[tuple[int, int]] = []
        while self._waiting and self._waiting[0][0] + REPEAT_S < now_s < self._heard_s + REPEAT_S:
            missed += self._waiting.popleft()[1]
        return Settled(kept, missed)


def spans_of(text: str) -> list[tuple[int, int]]:
    """The spans that a receipt names; what is no number names nothing."""
    spans = []
    for part in text.split()[:SPANS_MAX]:
        first, _, last = part.partition("-")
        if max(len(first), len(last)) > DIGITS_MAX:
            continue
        if first.isdecimal() and (last.isdecimal() or not last) and int(first) <= int(last or first):
            spans.append((int(first), int(last or first)))
    return spans


def _both(waiting: Spans, early: Spans) -> list[tuple[int, int]]:
    """Return what is in both, taken out of both."""
    both = [part for span in list(early) for part in waiting.discard(*span)]
    for part in both:
        early.discard(*part)
    return both
