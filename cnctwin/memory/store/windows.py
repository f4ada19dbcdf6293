"""Windows of time and what fell into them. Parts of a window from several places become one."""

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from cnctwin.memory.store.contract import Column
from cnctwin.memory.store.series_table import RANKS
from sparkplug.values import Value

StoredSample = tuple[int, Value, int, str | None]
"""A sample: time in µs, value, rank of its quality, reason."""


class Numbers(NamedTuple):
    """So many samples, all good, of which `good` are finite numbers; `last_us`: when the last of them was, or before."""

    samples: int
    good: int
    total: float
    low: float | None
    high: float | None
    last_us: int
    last: Value = None


class Window:
    """The sums of one window. A number counts for mean, low and high where it is good and finite."""

    __slots__ = ("count", "good", "high", "is_number", "last", "last_us", "low", "reason", "total", "worst", "worst_us")

    def __init__(self) -> None:
        self.count = self.good = self.worst = 0
        self.total, self.low, self.high = 0.0, math.inf, -math.inf
        self.last: Value = None
        self.last_us = self.worst_us = -1
        self.is_number = False
        self.reason: str | None = None

    def add_numbers(self, numbers: Numbers) -> None:
        """Many at once."""
        self.count += numbers.samples
        self.good += numbers.good
        self.total += numbers.total
        if numbers.low is not None and numbers.high is not None:
            self.low, self.high = min(self.low, numbers.low), max(self.high, numbers.high)
        if numbers.last_us > self.last_us:
            self.last_us, self.last, self.is_number = numbers.last_us, numbers.last, True

    def add(self, told: StoredSample) -> None:
        """One sample."""
        t, value, rank, reason = told
        self.count += 1
        is_number = type(value) in (float, int)
        if is_number and rank == 0 and math.isfinite(value):  # type: ignore[arg-type]
            number = float(value)  # type: ignore[arg-type]
            self.good += 1
            self.total += number
            self.low, self.high = min(self.low, number), max(self.high, number)
        if t > self.last_us:
            # A null says nothing of the type.
            self.is_number = is_number or (value is None and (self.is_number or self.good > 0))
            self.last_us, self.last = t, value
        if rank:
            self.mark(rank, t, reason)

    def mark(self, rank: int, t: int, reason: str | None) -> None:
        """Something in it is not good; the last of the worst says why."""
        if rank > self.worst or (rank == self.worst and t > self.worst_us):
            self.worst, self.worst_us, self.reason = rank, t, reason

    @property
    def value(self) -> Value:
        """The mean of its good numbers; of what is no number the last."""
        if self.good:
            return self.total / self.good
        return None if self.is_number else self.last


class Windows:
    """The windows of one signal, by their number since 1970.

    Nearly every window is put together once, by a database, and stays the numbers that came.
    """

    def __init__(self, every_ms: int) -> None:
        self.every_us = every_ms * 1000
        self._windows: dict[int, Window | Numbers] = {}

    def at(self, number: int) -> Window:
        """The window with this number."""
        window = self._windows.get(number)
        if type(window) is Window:
            return window
        made = self._windows[number] = Window()
        if type(window) is Numbers:
            made.add_numbers(window)
        return made

    def put(self, number: int, numbers: Numbers) -> None:
        """Many samples of a window at once."""
        if number in self._windows:
            self.at(number).add_numbers(numbers)
        else:
            self._windows[number] = numbers

    def put_all(self, numbers: Iterable[int], every: Iterable[Numbers]) -> None:
        """Many windows at once; those of which nothing is known are left out."""
        known = {number: one for number, one in zip(numbers, every, strict=True) if one.samples}
        if not self._windows:
            self._windows.update(known)
            return
        for number, one in known.items():
            self.put(number, one)

    def add(self, told: Iterable[StoredSample]) -> None:
        """Samples, one by one."""
        every_us = self.every_us
        for one in told:
            self.at(one[0] // every_us).add(one)

    def rows(self) -> Iterator[tuple[int, Window]]:
        """All, in order."""
        return ((number, self.at(number)) for number in sorted(self._windows))

    def column(self, signal: str, unit: str | None) -> Column:
        """As an answer."""
        numbers = sorted(self._windows)
        every = list(map(self._windows.__getitem__, numbers))
        t_us = [number * self.every_us for number in numbers]
        if every and set(map(type, every)) == {Numbers}:
            samples, good, total, low, high, _, _ = map(list, zip(*every, strict=True))
            value = [t / g if g else None for t, g in zip(total, good, strict=True)]
            return Column(signal, unit, t_us, value, [RANKS[0]] * len(every), [None] * len(every), low, high, samples)
        rows = list(map(_row, every))
        value, worst, reason, low, high, count = map(list, zip(*rows, strict=True)) if rows else ([], [], [], [], [], [])
        return Column(signal, unit, t_us, value, [RANKS[rank] for rank in worst], reason, low, high, count)


def _row(window: Window | Numbers) -> tuple[Value, int, str | None, float | None, float | None, int]:
    """Value, worst rank, reason, low, high, count."""
    if type(window) is Numbers:
        mean = window.total / window.good if window.good else None
        return mean, 0, None, window.low, window.high, window.samples
    assert type(window) is Window
    low, high = (window.low, window.high) if window.good else (None, None)
    return window.value, window.worst, window.reason, low, high, window.count


def raw_column(signal: str, unit: str | None, told: list[StoredSample]) -> Column:
    """Samples as they came; sorted here."""
    told.sort(key=lambda one: one[0])
    return Column(
        signal,
        unit,
        t_us=[one[0] for one in told],
        value=[one[1] for one in told],
        quality=[RANKS[one[2]] for one in told],
        reason=[one[3] for one in told],
        low=[],
        high=[],
        count=[],
    )
