"""Chance by absolute time: what an hour or a day draws is the same whichever stretch of time is computed."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
HOUR_S, DAY_S = 3600.0, 86_400.0
TAKEN = 3
"""The draws that neighbouring steps share but one: a mean of three independent ones goes on from step to step."""


def drawn(seed: int, what: int, number: int) -> np.random.Generator:
    """Return the source of chance for `what`, at step `number` of it."""
    return np.random.default_rng([seed, what, number])


def wandering(seed: int, what: int, at_s: Floats, step_s: float) -> Floats:
    """Return a course of standard deviation 1 that wanders from step to step (its correlation is 2/3), straight in between.

    >>> [round(float(value), 2) for value in wandering(1, 7, np.array([36000.0, 37800.0, 39600.0]), 3600.0)]
    [0.37, 0.14, -0.1]
    """
    if not len(at_s):
        return np.zeros(0)
    first, last = int(at_s[0] // step_s), int(at_s[-1] // step_s) + 1
    single = [float(drawn(seed, what, number).standard_normal()) for number in range(first - TAKEN + 1, last + 1)]
    nodes = np.convolve(single, np.ones(TAKEN), mode="valid") / np.sqrt(TAKEN)
    return np.asarray(np.interp(at_s / step_s, np.arange(first, last + 1), nodes))
