"""The last minutes of one signal, in arrays: 17 bytes a number instead of the 170 of a reading.

A trace holds at most `SAMPLES_MAX` samples of the last `AGE_MS_MAX`; twice as many are held for a moment, so that the oldest are
thrown away many at once.
"""

from array import array
from bisect import bisect_left
from typing import NamedTuple

from cnctwin.api.value_object import Plain
from sparkplug.quality import Quality

SAMPLES_MAX = 1200
AGE_MS_MAX = 600_000
SET_BACK_MS = 10_000
NOTES_MAX = 250
NAN = float("nan")


class Sample(NamedTuple):
    """One sample of a trace."""

    t_ms: int
    value: Plain
    quality: int
    reason: str | None


class Trace:
    """Times, values and notes (quality with reason) of one signal, oldest first."""

    __slots__ = ("_kind", "_noted", "_notes", "_texts", "_times", "_values")

    def __init__(self) -> None:
        self._kind: type = float
        self._times = array("q")
        self._values = array("d")
        self._texts: list[str | None] | None = None
        self._noted = bytearray()
        self._notes: list[tuple[int, str | None]] = [(Quality.GOOD, None)]

    def __len__(self) -> int:
        return len(self._times)

    def add_good(self, t_ms: int, number: float) -> bool:
        """The short way for nearly all samples: a good number that follows numbers. False where it has to go the long way."""
        times = self._times
        if self._texts is not None or self._kind is not float or (times and t_ms <= times[-1]):
            return False
        times.append(t_ms)
        self._values.append(number)
        self._noted.append(0)
        if len(times) >= 2 * SAMPLES_MAX:
            self._forget(0, SAMPLES_MAX)
        return True

    def add(self, t_ms: int, value: Plain, quality: int, reason: str | None) -> None:
        """One more sample. One of the same time replaces the last, an older one is left out; a clock set back begins again."""
        times = self._times
        if times and t_ms <= times[-1]:
            if 0 < times[-1] - t_ms <= SET_BACK_MS:
                return
            self._forget(len(times) - 1 if t_ms == times[-1] else 0, len(times))
        kind = value.__class__
        if (kind is str) is not (self._texts is not None) and value is not None:
            self._forget(0, len(times))
            self._texts = [] if kind is str else None
        if value is not None:
            self._kind = kind
        times.append(t_ms)
        self._noted.append(0 if quality == Quality.GOOD and reason is None else self._note(quality, reason))
        if self._texts is not None:
            self._texts.append(value if isinstance(value, str) else None)
        else:
            self._values.append(NAN if value is None or isinstance(value, str) else value)
        if len(times) >= 2 * SAMPLES_MAX:
            self._forget(0, SAMPLES_MAX)

    def since(self, from_ms: int, to_ms: int) -> list[Sample]:
        """The samples in [from_ms, to_ms)."""
        oldest_ms = max(from_ms, self.newest_ms - AGE_MS_MAX)
        first = max(len(self._times) - SAMPLES_MAX, bisect_left(self._times, oldest_ms))
        return [
            Sample(self._times[index], self._value(index), *self._notes[self._noted[index]])
            for index in range(max(first, 0), bisect_left(self._times, to_ms))
        ]

    @property
    def oldest_ms(self) -> int:
        """The time of the oldest sample that is still given; 0 where there is none."""
        if not self._times:
            return 0
        return max(self._times[max(len(self._times) - SAMPLES_MAX, 0)], self._times[-1] - AGE_MS_MAX)

    @property
    def newest_ms(self) -> int:
        """The time of the last sample; 0 where there is none."""
        return self._times[-1] if self._times else 0

    @property
    def is_stale(self) -> bool:
        """True if the last sample is one that a death made stale."""
        return bool(self._noted) and self._notes[self._noted[-1]][0] == Quality.STALE

    def _value(self, index: int) -> Plain:
        if self._texts is not None:
            return self._texts[index]
        number = self._values[index]
        if number != number:  # noqa: PLR0124  NaN stands for null
            return None
        return bool(number) if self._kind is bool else int(number) if self._kind is int else number

    def _note(self, quality: int, reason: str | None) -> int:
        note = (quality, reason)
        if note in self._notes:
            return self._notes.index(note)
        if len(self._notes) >= NOTES_MAX:
            note = (quality, None)
            if note in self._notes:
                return self._notes.index(note)
            if len(self._notes) >= NOTES_MAX + 3:
                return 0
        self._notes.append(note)
        return len(self._notes) - 1

    def _forget(self, first: int, end: int) -> None:
        del self._times[first:end]
        del self._noted[first:end]
        if self._texts is not None:
            del self._texts[first:end]
        else:
            del self._values[first:end]
