"""The motion that two recordings share although they did not begin at the same moment.

An oscilloscope is started by hand, so the same program stands at another place in each recording. The lag is the one at which
the references of all axes agree: the mean of (a_{i+lag} - b_i)² over the rows that both have is near zero. Where a program goes
round, several do, and the one that leaves most in common is taken.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cnctwin.composing.guessed import near_references
from twin.runlog import AXIS_COLUMN, RunLog

SHARED_MIN = 0.4
"""Part of the way of each recording that has to be shared. Of one lap after another anywhere, two share half at least."""
EVEN = 0.01
"""Part of a sample period by which rows may be uneven."""
ROWS_MIN = 100
TRIED_MAX = 20
Floats = NDArray[np.float64]


class Shared(NamedTuple):
    """A stretch of rows that two recordings share: where it begins in each, and its length."""

    one: int
    other: int
    rows: int


def shared_motion(one: RunLog, other: RunLog) -> Shared | None:
    """Return the rows over which two recordings go through the same; None where there is too little of it.

    >>> from twin.runlog import run_log
    >>> way = np.sin(np.arange(400) / 30.0) * np.arange(400)
    >>> a, b = (run_log({"t_s": np.arange(300.0), "x_ref_mm": way[n : n + 300]}) for n in (0, 80))
    >>> shared_motion(a, b)
    Shared(one=80, other=0, rows=220)
    """
    names = [c for c in one.columns if (m := AXIS_COLUMN.match(c)) and m[2] in ("ref_mm", "ref_deg")]
    if not names or not all(other.has(c) for c in names) or min(len(one), len(other)) < ROWS_MIN or not _same_pace(one, other):
        return None
    a, b = (np.stack([log[c] for c in names]) for log in (one, other))
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        return None
    widest = int(np.argmax(np.ptp(a, axis=1)))
    ways = [_way(side) for side in (a, b)]
    for lag in _lags(a[widest], b[widest]):
        found = Shared(max(lag, 0), max(-lag, 0), min(len(one) - max(lag, 0), len(other) - max(-lag, 0)))
        begins = (found.one, found.other)
        parts = [w[s + found.rows - 1] - w[s] for w, s in zip(ways, begins, strict=True)]
        if any(part < SHARED_MIN * w[-1] or part == 0.0 for part, w in zip(parts, ways, strict=True)):
            continue
        cut = [side[:, s : s + found.rows] for side, s in zip((a, b), begins, strict=True)]
        if all(near_references(x, y) for x, y in zip(*cut, strict=True)):
            return found
    return None


def _same_pace(one: RunLog, other: RunLog) -> bool:
    steps = np.concatenate([np.diff(one.t_s), np.diff(other.t_s)])
    middle = float(np.median(steps))
    return bool(np.all(np.abs(steps - middle) < EVEN * middle))


def _way(references: Floats) -> Floats:
    """Return the way that all axes have gone since the first row."""
    return np.concatenate([[0.0], np.cumsum(np.abs(np.diff(references, axis=1)).sum(axis=0))])


def _lags(a: Floats, b: Floats) -> list[int]:
    """Return the lags at which one course lies on the other, the longest stretch in common first."""
    a, b = a - a.mean(), b - a.mean()
    size = 1 << (len(a) + len(b)).bit_length()
    together = np.fft.irfft(np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size)), size)
    lags = np.arange(ROWS_MIN - len(b), len(a) - ROWS_MIN + 1)
    begin, rows = np.maximum(lags, 0), np.minimum(len(a), len(b) + lags) - np.maximum(lags, 0)
    energies = [np.concatenate([[0.0], np.cumsum(side**2)]) for side in (a, b)]
    energy = energies[0][begin + rows] - energies[0][begin]
    energy += energies[1][begin - lags + rows] - energies[1][begin - lags]
    apart = (energy - 2.0 * together[lags % size]) / rows
    lowest = np.concatenate([[True], apart[1:] <= apart[:-1]]) & np.concatenate([apart[:-1] <= apart[1:], [True]])
    near = np.flatnonzero(lowest & (apart < 1e-6 * np.var(a)))
    return [int(lag) for lag in lags[near[np.argsort(-rows[near], kind="stable")]][:TRIED_MAX]]
