"""Detectors and drift detectors of others, on the signals beside what is usual in the operation, in frames of 10 s; gate only.

    hbos, pca        of PyOD, trained on the rows of week A (ECOD takes 10 ms a row, LODA cannot score a stream)
    page             S ← max(0, S + y − 0.5), the larger of both sides, the sum over signals (Page 1954): river's PageHinkley,
                     with a known mean. Gated frames leave S as it is.

river, with its ADWIN and PageHinkley, is not among the dependencies, so its own code has no line here.
"""

from collections.abc import Callable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from benchmarks.simulated_cell.signals import FEATURES
from twin.anomaly.detector import Detector, trained_model

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
SLACK = 0.5
ROWS_MAX = 20_000
Score = Callable[[Floats, Flags, slice], Floats]


def of_pyod(name: str) -> Score:
    """Return the score of a detector of PyOD, of rows (T, F) of which those not idle in `train` are learned."""

    def score(rows: Floats, idle: Flags, train: slice) -> Floats:
        learned = rows[train][~idle[train]]
        every = max(1, len(learned) // ROWS_MAX)
        found = np.zeros(len(rows))
        judged = np.flatnonzero(~idle)
        found[judged] = trained_model(Detector(name), learned[::every], FEATURES).scores(rows[judged])
        return found

    return score


def page(rows: Floats, idle: Flags, _: slice) -> Floats:
    """Return Page's statistic of rows (T, F)."""
    return _page(rows, idle)


@njit(cache=True)
def _page(rows: Floats, idle: Flags) -> Floats:
    found = np.zeros(len(rows))
    up, down = np.zeros(rows.shape[1]), np.zeros(rows.shape[1])
    for tick in range(len(rows)):
        total = 0.0
        for signal in range(rows.shape[1]):
            if not idle[tick]:
                up[signal] = max(0.0, up[signal] + rows[tick, signal] - SLACK)
                down[signal] = max(0.0, down[signal] - rows[tick, signal] - SLACK)
            total += max(up[signal], down[signal])
        found[tick] = total
    return found


SCORES: dict[str, Score] = {"hbos": of_pyod("HBOS"), "pca": of_pyod("PCA"), "page": page}
