"""A reading in steps: what a display shows in whole percents, or a control sends in tenths of a degree.

A reading r in steps of s says that the value lies within r ± s/2, and no more. What a twin shows beside it counts by how far it
is outside that range, so no twin is blamed for the rounding, and none is praised for guessing it:

    shown = r + sgn(x − r) max(|x − r| − s/2, 0),   x the value of the twin

Steps that are smaller than the noise of the sensor hide nothing: there the value stays as it is.
"""

import numpy as np
from numpy.typing import NDArray

from twin.simulator.recorded import resolution

Floats = NDArray[np.float64]


def coarse_step(recorded: Floats, floor: Floats) -> float:
    """Return the step in which a signal, (n,), was recorded where that is coarser than its floor, (n,); else 0.

    >>> coarse_step(np.array([21.0, 21.5, 22.0]), np.full(3, 0.03)), coarse_step(np.array([21.0, 21.5, 22.0]), np.full(3, 0.8))
    (0.5, 0.0)
    """
    step = resolution(recorded)
    return step if step > float(np.nanmedian(floor)) else 0.0


def as_read(shown: Floats, recorded: Floats, step: float) -> Floats:
    """Return what a twin shows, (…, n), beside a recording in steps, (n,): the recorded value wherever that may stand for it.

    >>> as_read(np.array([21.1, 21.4, 20.7]), np.array([21.0, 21.0, 21.0]), 0.5).round(2).tolist()
    [21.0, 21.15, 20.95]
    """
    if step <= 0.0:
        return shown
    return np.asarray(shown - np.clip(shown - recorded, -0.5 * step, 0.5 * step))
