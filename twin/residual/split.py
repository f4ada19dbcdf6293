"""Splits by time: what is held out lies after all that is trained on, with a gap between them.

The residual of a temperature changes slowly, so two rows of one hour are nearly the same row. Where training and test are drawn
from the same hours, a forest looks its test rows up; the figure says nothing of tomorrow. The gap is as long as the residual
remembers: until its autocorrelation is below 0.1, and at least three time constants of the physics.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.residual.errors import ResidualError

Floats = NDArray[np.float64]
Places = NDArray[np.intp]
FORGOTTEN = 0.1
TIME_CONSTANTS = 3.0
GAP_SHARE_MAX = 0.125
"""Largest part of the recorded time for a gap; a residual that remembers longer is a constant to this recording."""
BLOCKS_MIN = 8
GRID_S = 60.0


@dataclass(frozen=True, slots=True, eq=False)
class Split:
    """train, test: places of rows; gap_s between them; block: (tests,) block of time of each test row"""

    train: Places
    test: Places
    gap_s: float
    block: NDArray[np.int64]

    @property
    def blocks(self) -> int:
        """The number of blocks of held-out time."""
        return len(np.unique(self.block))


def remembers_s(t_s: Floats, residual: Floats, stretch: NDArray[np.int64], most_s: float) -> float:
    """Return the memory of the residual (n,), s: the first lag at which its autocorrelation is below 0.1; at most `most_s`.

    stretch: (n,) numbers; pairs of different ones do not count
    """
    slot = np.floor(t_s / GRID_S).astype(np.int64)
    _, first = np.unique(slot, return_index=True)
    at, value, own = slot[first], residual[first] - residual.mean(), stretch[first]
    variance = float((value**2).mean())
    if variance == 0.0:
        return 0.0
    lag = 1
    while lag * GRID_S < most_s:
        there = np.searchsorted(at, at + lag)
        found = np.flatnonzero(there < len(at))
        found = found[(at[there[found]] == at[found] + lag) & (own[there[found]] == own[found])]
        if len(found) < 10:
            break
        if float((value[found] * value[there[found]]).mean()) < FORGOTTEN * variance:
            return lag * GRID_S
        lag += max(1, lag // 10)
    return min(lag * GRID_S, most_s)


def split_by_time(t_s: Floats, residual: Floats, stretch: NDArray[np.int64], held_share: float, time_constant_s: float) -> Split:
    """The last `held_share` of the rows (n,) held out, and a gap before them. Raises ResidualError where it is too little."""
    row_s = float(np.median(np.diff(t_s)))
    most_s = GAP_SHARE_MAX * len(t_s) * row_s
    cut_s = float(t_s[int((1.0 - held_share) * len(t_s))])
    before = t_s < cut_s
    memory_s = remembers_s(t_s[before], residual[before], stretch[before], most_s)
    gap_s = max(memory_s, min(TIME_CONSTANTS * time_constant_s, most_s), row_s)
    train, test = np.flatnonzero(t_s < cut_s - gap_s), np.flatnonzero(t_s >= cut_s)
    block = blocks_of(t_s[test], gap_s)
    if len(np.unique(block)) < BLOCKS_MIN or len(train) < 100:
        raise ResidualError(
            f"{len(test) * row_s / 3600.0:.1f} h held out are {len(np.unique(block))} stretches of {gap_s / 3600.0:.1f} h, "
            f"which is how long the residual remembers; an interval needs {BLOCKS_MIN}: record more, or hold more out"
        )
    return Split(train, test, gap_s, block)


def blocks_of(t_s: Floats, block_s: float) -> NDArray[np.int64]:
    """Number of the block of time of each row, (n,), each `block_s` long."""
    return np.asarray(np.floor((t_s - t_s[0]) / block_s).astype(np.int64))
