"""VUS-PR: the volume under the precision-recall surface (Paparrizos et al. 2022, "Volume under the surface", PVLDB 15(11)).

Labels are softened at their edges by a buffer of l ticks, half of it on either side: l_r = sqrt(1 − distance / l). At a threshold

    TP_l = Σ l_r · predicted        recall = min(1, TP_l / P_l) · (share of events touched)        P_l = Σ (label + l_r) / 2
                                    precision = TP_l / Σ predicted

The area under precision over recall is taken at each l, and its mean over l from 0 to `buffer_max` is the volume. It needs no
threshold, and a detection a little early or late is no miss. Own implementation.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.evaluation.range_based import Range

Floats = NDArray[np.float64]
THRESHOLDS = 250


def vus_pr(scores: Floats, events: Sequence[Range], buffer_max: int, steps: int = 8) -> float:
    """Return the measure of scores (T,), −∞ or 0 where they are not judged; NaN without events.

    >>> scores = np.array([0.0, 0.1, 0.9, 0.8, 0.0, 0.1])
    >>> vus_pr(scores, [Range(2, 4)], 0)
    1.0
    """
    if not events:
        return float("nan")
    order = np.argsort(-scores, kind="stable")
    buffers = sorted({round(step * buffer_max / max(1, steps)) for step in range(steps + 1)})
    return float(np.mean([area_pr(scores, events, buffer, order) for buffer in buffers]))


def area_pr(scores: Floats, events: Sequence[Range], buffer: int, order: NDArray[np.intp] | None = None) -> float:
    """The area at one buffer length."""
    order = np.argsort(-scores, kind="stable") if order is None else order
    count, half = len(scores), buffer // 2
    soft, hard = soft_labels(count, events, buffer), soft_labels(count, events, 0)
    positives = float((soft + hard).sum()) / 2.0
    ranked = scores[order]
    ends = np.flatnonzero(np.append(ranked[1:] != ranked[:-1], True)) + 1
    if len(ends) > THRESHOLDS:
        ends = ends[np.unique(np.linspace(0, len(ends) - 1, THRESHOLDS).astype(int))]
    hits = np.cumsum(soft[order])[ends - 1]
    best = np.sort([float(scores[max(0, one.start - half) : one.end + half].max()) for one in events])
    touched = (len(best) - np.searchsorted(best, ranked[ends - 1], side="left")) / len(best)
    recall = np.minimum(1.0, hits / positives) * touched
    precision = hits / ends
    return float((np.diff(recall, prepend=0.0) * precision).sum())


def soft_labels(count: int, events: Sequence[Range], buffer: int) -> Floats:
    """Labels with softened edges.

    >>> soft_labels(6, [Range(2, 4)], 4).round(2).tolist()
    [0.71, 0.87, 1.0, 1.0, 0.87, 0.71]
    """
    soft, half = np.zeros(count), buffer // 2
    for one in events:
        for away in range(1, half + 1):
            value = (1.0 - away / buffer) ** 0.5
            for tick in (one.start - away, one.end - 1 + away):
                if 0 <= tick < count:
                    soft[tick] = max(soft[tick], value)
        soft[max(0, one.start) : max(0, one.end)] = 1.0
    return soft
