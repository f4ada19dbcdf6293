"""Sets of whole numbers as sorted spans, first to last: which rows of the store wait, and which are on their way.

A day of rows is one span, not a million numbers.

>>> waiting = Spans([(1, 4)])
>>> waiting.add(6, 6)
>>> waiting.add(5, 5)
>>> waiting.take(2), list(waiting), len(waiting)
((1, 2), [(3, 6)], 4)
"""

import math
from bisect import bisect_left, bisect_right, insort
from collections.abc import Iterable, Iterator


class Spans:
    """A set of whole numbers that grows mostly at its end and shrinks mostly at its beginning."""

    def __init__(self, spans: Iterable[tuple[int, int]] = ()) -> None:
        self._spans: list[tuple[int, int]] = []
        for first, last in spans:
            self.add(first, last)

    def __iter__(self) -> Iterator[tuple[int, int]]:
        return iter(self._spans)

    def __len__(self) -> int:
        return sum(last - first + 1 for first, last in self._spans)

    def __bool__(self) -> bool:
        return bool(self._spans)

    def __contains__(self, number: int) -> bool:
        at = bisect_right(self._spans, (number, math.inf)) - 1
        return at >= 0 and number <= self._spans[at][1]

    def add(self, first: int, last: int) -> None:
        """Put in `first` to `last`, of which none may be in it; neighbours become one span."""
        if self._spans and self._spans[-1][1] == first - 1:  # the usual case
            self._spans[-1] = self._spans[-1][0], last
            return
        insort(self._spans, (first, last))
        at = bisect_left(self._spans, (first, last))
        for left in (at, at - 1):
            if 0 <= left < len(self._spans) - 1 and self._spans[left][1] + 1 == self._spans[left + 1][0]:
                self._spans[left : left + 2] = [(self._spans[left][0], self._spans[left + 1][1])]

    def include(self, first: int, last: int) -> None:
        """Put in what of `first` to `last` is not in it yet.

        >>> spans = Spans([(1, 4), (7, 9)])
        >>> spans.include(3, 6), list(spans)
        (None, [(1, 9)])
        """
        if not self._spans or self._spans[-1][1] < first:
            self.add(first, last)
            return
        self.discard(first, last)
        self.add(first, last)

    def cut(self, upto: int) -> None:
        """Take out all numbers up to this one."""
        while self._spans and self._spans[0][0] <= upto:
            _, last = self._spans.pop(0)
            if last > upto:
                self._spans.insert(0, (upto + 1, last))

    def discard(self, first: int, last: int) -> list[tuple[int, int]]:
        """Take out what of `first` to `last` is in it; the spans of that.

        >>> spans = Spans([(1, 4), (7, 9)])
        >>> spans.discard(3, 7), list(spans)
        ([(3, 4), (7, 7)], [(1, 2), (8, 9)])
        """
        begin = max(bisect_left(self._spans, (first, first)) - 1, 0)
        end = begin
        out: list[tuple[int, int]] = []
        rest: list[tuple[int, int]] = []
        while end < len(self._spans) and self._spans[end][0] <= last:
            low, high = self._spans[end]
            end += 1
            if high < first:
                rest.append((low, high))
                continue
            out.append((max(low, first), min(high, last)))
            rest += [(low, first - 1)] if low < first else []
            rest += [(last + 1, high)] if high > last else []
        self._spans[begin:end] = rest
        return out

    def take(self, number_max: int) -> tuple[int, int] | None:
        """Take out the lowest span, but no more than so many; None where there is nothing."""
        if not self._spans:
            return None
        first, last = self._spans[0]
        until = min(last, first + number_max - 1)
        if until == last:
            del self._spans[0]
        else:
            self._spans[0] = until + 1, last
        return first, until
