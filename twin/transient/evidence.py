"""The evidence of other signals for a pattern, and how likely it makes a tool change: logistic regression on few robust features.

While a tool is exchanged the axes stand and the program does not advance. Both are told as run lengths, in samples: for how long
the path feed has been nil, for how long the same block has been executed. A feature is the longest such stretch between the
beginning and the end of the pattern, as log seconds, so that a machine that is slower by a factor differs by a fixed amount.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
FEED, BLOCK = "feed_mm_min", "block"
KINDS = (FEED, BLOCK)
UNKNOWN = -1.0
RESTING_MM_MIN = 10.0
SECONDS_MIN, SECONDS_MAX = 0.25, 60.0


def run_length(before: float, holds: bool | None) -> float:
    """Samples for which something has held, with this one; UNKNOWN where it is not known whether it does.

    >>> run_length(3.0, True), run_length(3.0, False), run_length(3.0, None), run_length(UNKNOWN, True)
    (4.0, 0.0, -1.0, 1.0)
    """
    if holds is None:
        return UNKNOWN
    return max(before, 0.0) + 1.0 if holds else 0.0


def longest(run_lengths: Floats, period_s: float) -> float | None:
    """log seconds of the longest stretch that lies in this window, (n,), as far as known; None where it ends unknown."""
    if not len(run_lengths) or run_lengths[-1] < 0.0:
        return None
    within = np.minimum(run_lengths, np.arange(1.0, len(run_lengths) + 1.0))
    return float(np.log(min(max(within.max() * period_s, SECONDS_MIN), SECONDS_MAX)))


TOLERANCE = float(np.log(1.5))
"""A machine may be so much slower or faster than the one that was learned from, before that speaks against it."""


@dataclass(frozen=True, slots=True)
class Weighing:
    """p = 1 / (1 + exp(−(bias + Σ weight (feature − centre) / spread))).

    typical: of captured changes, for a feature that should be neither shorter nor longer: it then counts as how far it is from
    that, beyond TOLERANCE; None for one of which more is better
    """

    names: tuple[str, ...]
    typical: tuple[float | None, ...]
    centres: tuple[float, ...]
    spreads: tuple[float, ...]
    weights: tuple[float, ...]
    bias: float

    def logit(self, features: Sequence[float]) -> float:
        """The log odds."""
        counted = (_counted(value, typical) for value, typical in zip(features, self.typical, strict=True))
        parts = zip(self.weights, counted, self.centres, self.spreads, strict=True)
        return self.bias + sum(weight * (value - centre) / spread for weight, value, centre, spread in parts)


def _counted(value: float, typical: float | None) -> float:
    return value if typical is None else -max(0.0, abs(value - typical) - TOLERANCE)


def probability(logit: float) -> float:
    """Return the probability of log odds.

    >>> probability(0.0)
    0.5
    """
    return float(1.0 / (1.0 + np.exp(-np.clip(logit, -50.0, 50.0))))


RIDGE = 1.0
STEPS = 50


def weighing_of(names: tuple[str, ...], has_typical: Sequence[bool], raw: Floats, is_change: NDArray[np.bool_]) -> Weighing:
    """Fit to (n, f) features by Newton steps; both classes weigh the same, weights are held by a ridge of 1 and not below 0.

    Each feature is one that is larger in a change: what the few examples say against that is chance. Where the examples can be
    told apart, even odds are put halfway between them.
    """
    typical = tuple(float(np.median(column[is_change])) if has else None for has, column in zip(has_typical, raw.T, strict=True))
    features = np.array([[_counted(float(value), of) for value, of in zip(row, typical, strict=True)] for row in raw])
    centres = features.mean(axis=0)
    spreads = np.maximum(features.std(axis=0), 1e-6)
    x = np.column_stack([(features - centres) / spreads, np.ones(len(features))])
    y = is_change.astype(np.float64)
    w = np.where(is_change, 0.5 / max(is_change.sum(), 1), 0.5 / max((~is_change).sum(), 1)) * len(y)
    ridge = np.diag([RIDGE] * len(names) + [0.0])
    free = np.ones(len(names) + 1, dtype=bool)
    while True:
        beta = np.zeros(len(names) + 1)
        for _ in range(STEPS):
            p = 1.0 / (1.0 + np.exp(-np.clip(x @ beta, -30.0, 30.0)))
            gradient = x.T @ (w * (y - p)) - ridge @ beta
            hessian = (x * (w * p * (1.0 - p))[:, None]).T @ x + ridge + 1e-9 * np.eye(len(beta))
            move = np.linalg.solve(hessian[np.ix_(free, free)], gradient[free])
            beta[free] += move
            if float(np.abs(move).max()) < 1e-10:
                break
        negative = free & (beta < 0.0)
        negative[-1] = False
        if not negative.any():
            break
        free &= ~negative
    odds = x @ beta
    least, most = float(odds[is_change].min()), float(odds[~is_change].max())
    bias = float(beta[-1]) - ((least + most) / 2.0 if least > most else 0.0)
    weights = tuple(float(value) for value in beta[:-1])
    return Weighing(names, typical, tuple(map(float, centres)), tuple(map(float, spreads)), weights, bias)
