"""Intervals of figures of series that are correlated in time.

The series is cut into blocks three integral autocorrelation times long (`twin.gap.significance`); blocks are drawn with
replacement, and the figure is taken of the sums over what was drawn. The percentiles are too narrow: with few blocks by
√(b / (b − 1)) · t₀.₉₇₅(b − 1) / 1.96, and since blocks hold on to a part of the variance, of an exponential memory a sixth where
they are three times its integral time. They are moved out from the figure by both.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from twin.gap.significance import correlation_time

Floats = NDArray[np.float64]
Figures = Callable[[Floats], Floats]
"""Sums (d, k) → figures (d,)."""
BLOCKS_MIN, BLOCKS_MAX = 6, 400
"""Neighbours are put together beyond that: longer blocks are as good, and cost less."""
BLOCK_TIMES = 3.0
HELD_BACK = 1.0 / (2.0 * BLOCK_TIMES)
DRAWS = 1000
SEED = 7
COVERAGE = 0.95
Z = 1.959963984540054


class Interval(NamedTuple):
    """value; low and high: None where there are fewer than BLOCKS_MIN blocks; blocks: how many there are."""

    value: float
    low: float | None
    high: float | None
    blocks: int


def block_samples(error: Floats) -> int:
    """Samples in a block, of a series (n,) that is NaN where nothing is known.

    >>> noise = np.random.default_rng(1).standard_normal(4000)
    >>> block_samples(noise) <= 4, block_samples(np.convolve(noise, np.ones(20), mode="same")) > 40
    (True, True)
    """
    known = np.isfinite(error)
    if known.sum() < 4:
        return 1
    centred = np.where(known, error - np.mean(error[known]), 0.0)
    return max(1, int(np.ceil(BLOCK_TIMES * correlation_time(centred))))


def block_sums(terms: Floats, length: int) -> Floats:
    """Sums (blocks, k) of terms (n, k) over blocks of `length`; rows with NaN count nowhere, empty blocks are left out."""
    known: NDArray[np.bool_] = np.asarray(np.isfinite(terms).all(axis=1))
    kept = np.where(known[:, None], terms, 0.0)
    starts = np.arange(0, len(terms), max(1, length))
    if not len(starts):
        return np.zeros((0, terms.shape[1]))
    sums = np.add.reduceat(kept, starts, axis=0)
    return np.asarray(sums[np.add.reduceat(known.astype(np.int64), starts) > 0])


def bootstrapped(sums: Floats, figure: Figures, draws: int = DRAWS, seed: int = SEED) -> Interval:
    """The figure of block sums (b, k), with its interval.

    The mean of 4000 samples of noise with a standard deviation of 1 is known to 0.03:

    >>> noise = np.random.default_rng(2).standard_normal((4000, 1))
    >>> found = bootstrapped(block_sums(np.hstack([noise, np.ones_like(noise)]), 4), lambda s: s[:, 0] / s[:, 1])
    >>> found.blocks, 0.05 < found.high - found.low < 0.075
    (334, True)
    """
    value = float(figure(sums.sum(axis=0, keepdims=True))[0])
    if len(sums) > BLOCKS_MAX:
        sums = np.add.reduceat(sums, np.arange(0, len(sums), -(-len(sums) // BLOCKS_MAX)), axis=0)
    blocks = len(sums)
    if blocks < BLOCKS_MIN or not np.isfinite(value):
        return Interval(value, None, None, blocks)
    rng = np.random.default_rng(seed)
    weight = rng.multinomial(blocks, np.full(blocks, 1.0 / blocks), size=draws).astype(np.float64)
    drawn = figure(weight @ sums)
    low, high = np.nanquantile(drawn, [0.5 - COVERAGE / 2.0, 0.5 + COVERAGE / 2.0])
    held_back = 1.0 / np.sqrt(1.0 - HELD_BACK)
    wider = float(held_back * np.sqrt(blocks / (blocks - 1.0)) * stdtrit(blocks - 1.0, 0.5 + COVERAGE / 2.0) / Z)
    return Interval(
        value, min(value, value + wider * (float(low) - value)), max(value, value + wider * (float(high) - value)), blocks
    )
