"""The last samples of a stream, as a value: `grown` gives the next one, and the one before stays as it was.

Successive histories share their array: a sample is written behind the end of the older one, where that one never looks. Who
adds to a history that has been added to already, or to a full array, copies first (`with_room`). So a sample costs the same as
in a ring that is written over, and a step that fails leaves no trace.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SAMPLES, SUMS, SQUARES, OTHERS = 0, 1, 2, 3
"""Rows: samples in whole quanta; their sum and the sum of their squares up to, not with, each; others from OTHERS on."""


class History(NamedTuple):
    """rows: (3 + others, 2 length + 1); end: samples in it; tip: the end of the newest history on this array.

    seen: samples since the stream began, those that have been let go too
    """

    rows: Floats
    end: int
    tip: list[int]
    seen: int

    @classmethod
    def empty(cls, length: int, others: int = 0) -> "History":
        """A history that keeps at least the last `length` samples, each with so many other values."""
        return cls(np.zeros((OTHERS + others, 2 * length + 1)), 0, [0], 0)

    @classmethod
    def of(cls, kept: Sequence[Sequence[float]] | Floats, length: int, seen: int) -> "History":
        """The history of the values that `kept` gave: samples, then the others, row by row."""
        history = cls.empty(length, len(kept) - 1)
        samples = np.asarray(kept[0], dtype=np.float64)
        end = len(samples)
        history.rows[SAMPLES, :end] = samples
        history.rows[SUMS, 1 : end + 1] = np.cumsum(samples)
        history.rows[SQUARES, 1 : end + 1] = np.cumsum(samples * samples)
        for row, values in enumerate(kept[1:], start=OTHERS):
            history.rows[row, :end] = values
        return cls(history.rows, end, [end], seen)

    @property
    def length(self) -> int:
        """The least number of samples that it keeps."""
        return int((self.rows.shape[1] - 1) // 2)

    def kept(self) -> Floats:
        """The last `length` samples and below them the others: all that the future depends on."""
        return self.rows[[SAMPLES, *range(OTHERS, len(self.rows))], max(0, self.end - self.length) : self.end]

    def with_room(self) -> "History":
        """The same history, with room for one more sample that nobody else writes to."""
        if self.tip[0] == self.end and self.end + 1 < self.rows.shape[1]:
            return self
        return History.of(self.kept(), self.length, self.seen)

    def grown(self) -> "History":
        """The history with the sample that was just written behind its end."""
        rows, end, tip, seen = self
        tip[0] = end + 1
        return History(rows, end + 1, tip, seen + 1)
