"""Normalised cross correlation of a stream with a bank, at its newest sample.

    rho = Σ w x / sqrt(Σ (x − mean x)²)        w of mean 0 and norm 1

One dot product for each stretched form of each part. Mean and energy come from exact sums (`twin.transient.history`). The dot
product is reassociated, so that it is vectorised: its bits depend on the samples of the window alone, not on where they lie.

The oracle is `scipy.signal.correlate` (tests/twin/transient/test_matching.py).
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from twin.kernels.compiling import kernel
from twin.transient.level import QUANTA_MAX

Floats = NDArray[np.float64]
SLACK = 1.5
"""A part of a pattern may be smaller or larger than the whole by so much."""


@njit(fastmath={"reassoc", "nsz", "contract"})
def dot(weights: Floats, samples: Floats) -> float:
    """Σ w x of two windows of equal length."""
    total = 0.0
    for j in range(len(weights)):
        total += weights[j] * samples[j]
    return total


@kernel
def append(rows: Floats, end: int, quanta: float, feed_rest: float, block_stand: float) -> None:
    """Write a sample and its run lengths behind `end`."""
    sample = min(max(np.rint(quanta), -QUANTA_MAX), QUANTA_MAX)
    rows[0, end] = sample
    rows[1, end + 1] = rows[1, end] + sample
    rows[2, end + 1] = rows[2, end] + sample * sample
    rows[3, end] = feed_rest
    rows[4, end] = block_stand


@kernel
def best_parts(
    rows: Floats, end: int, weights: Floats, terms: Floats, low: float, high: float, out: Floats
) -> tuple[float, float]:
    """The best rho of a start, and of an end, in the windows up to `end`.

    low, high: deviation of a pattern; of a part of it, as the template has them, with SLACK
    out: (4, k): rho of the start, of the end, and the two sums Σ w x. rho is 0 where there are too few samples, or the window is
    flat, or too small or too large to be part of a pattern.
    """
    count, longest = terms.shape[1], weights.shape[1]
    best_start, best_end = 0.0, 0.0
    for k in range(count):
        both = terms[0, k] + terms[1, k]
        for part in range(2):
            n = int(terms[part, k])
            rho = 0.0
            if n <= end:
                mean = (rows[1, end] - rows[1, end - n]) / n
                energy = rows[2, end] - rows[2, end - n] - n * mean * mean
                own = terms[4 + part, k] * np.sqrt(both)  # its part of the deviation, times the root of n
                smallest, largest = low * own / SLACK, high * own * SLACK
                # A deviation of one quantum is rounding, no shape.
                if energy >= n and smallest * smallest <= energy <= largest * largest:
                    total = dot(weights[part * count + k, longest - n :], rows[0, end - n : end])
                    out[2 + part, k] = total
                    rho = total / np.sqrt(energy)
            out[part, k] = rho
        best_start, best_end = max(best_start, out[0, k]), max(best_end, out[1, k])
    return best_start, best_end


@kernel
def best_pattern(
    rows: Floats, end: int, since: int, gate: float, weights: Floats, terms: Floats, out: Floats
) -> tuple[float, int, int, float]:
    """The best beginning before each end whose rho is at least `gate`, over all allowed gaps; both count as one window.

    since: samples from there on may be used; out: as `best_parts` left it
    Returns rho of both together, which stretch, samples between, and the deviation of both together; rho −1 where no beginning
    fits in.
    """
    best, best_k, best_gap, best_deviation = -1.0, 0, 0, 0.0
    longest = weights.shape[1]
    for k in range(terms.shape[1]):
        if out[1, k] < gate:
            continue
        d, r = int(terms[0, k]), int(terms[1, k])
        end_sum = rows[1, end] - rows[1, end - r]
        end_total = out[3, k] * terms[5, k] + terms[7, k] * end_sum
        for gap in range(int(terms[2, k]), int(terms[3, k]) + 1):
            over = end - r - gap
            if over - d < since:
                break
            start_sum = rows[1, over] - rows[1, over - d]
            mean = (start_sum + end_sum) / (d + r)
            squares = rows[2, over] - rows[2, over - d] + rows[2, end] - rows[2, end - r]
            energy = squares - (d + r) * mean * mean
            if energy < d + r:
                continue
            total = dot(weights[k, longest - d :], rows[0, over - d : over])
            rho = (total * terms[4, k] + terms[6, k] * start_sum + end_total) / np.sqrt(energy)
            if rho > best:
                best, best_k, best_gap, best_deviation = rho, k, gap, np.sqrt(energy / (d + r))
    return best, best_k, best_gap, best_deviation
