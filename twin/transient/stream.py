"""A recorded stream at a steady period: the signal, what other signals say, and when tools were changed.

Between reports a control's value holds, so a recording that was written on change is held, too.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.transient.evidence import RESTING_MM_MIN, UNKNOWN, run_length

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Stream:
    """One piece without holes. values, feed_rest, block_stand: (n,), the latter two as run lengths in samples, UNKNOWN = −1.

    begin_s: time of the first sample; changes_s: times within it at which a tool was being changed; source: for messages
    """

    period_s: float
    begin_s: float
    values: Floats
    feed_rest: Floats
    block_stand: Floats
    changes_s: tuple[float, ...] = ()
    source: str = "stream"

    @property
    def hours(self) -> float:
        """The duration of the stream."""
        return len(self.values) * self.period_s / 3600.0

    def index(self, at_s: float) -> int:
        """The first sample at or after a time."""
        return int(np.ceil((at_s - self.begin_s) / self.period_s - 1e-9))

    def window(self, at_s: float, before_s: float, after_s: float) -> Floats:
        """The values around a time, as far as there are any."""
        return self.values[max(0, self.index(at_s - before_s)) : max(0, self.index(at_s + after_s))]


def held(t_s: Floats, values: Floats, grid_s: Floats) -> Floats:
    """The last of `values` at or before each time of the grid; NaN before the first."""
    known = np.isfinite(values)
    at = np.searchsorted(t_s[known], grid_s, side="right") - 1
    return np.where(at >= 0, values[known][np.maximum(at, 0)], np.nan) if known.any() else np.full(len(grid_s), np.nan)


def resting(feed_mm_min: Floats) -> Floats:
    """Run lengths of no feed."""
    return _runs([None if np.isnan(feed) else bool(abs(feed) < RESTING_MM_MIN) for feed in feed_mm_min])


def standing(block: Floats) -> Floats:
    """Run lengths of one block being executed."""
    known = ~np.isnan(block)
    same = [bool(is_known) and n > 0 and block[n] == block[n - 1] for n, is_known in enumerate(known)]
    return _runs([value if is_known else None for value, is_known in zip(same, known, strict=True)])


def _runs(holds: list[bool | None]) -> Floats:
    lengths, length = np.empty(len(holds)), UNKNOWN
    for n, value in enumerate(holds):
        length = run_length(length, value)
        lengths[n] = length
    return lengths
