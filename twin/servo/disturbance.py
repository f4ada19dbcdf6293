"""The force that nobody commands: chips, wipers, pumps, the floor. Small, coloured, and why a machine does not repeat itself.

    d(t): stationary Ornstein–Uhlenbeck process, standard deviation σ, correlation time τ: E[d(t) d(t + s)] = σ² exp(−|s| / τ)

It matters beyond its size. An axis that creeps to a stop is let go and caught by it until the error has changed its sign, so a
machine always stops a little past its reference, where the model without it stops a little short; the torque at which it breaks
away later follows from that. The twin of such a machine is the mean over many of its courses, and their spread is what repeated
runs differ by.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Floats = NDArray[np.float64]
CORRELATIONS_S = (0.008, 0.035, 0.15)
"""The correlation times that are tried on recordings."""


@dataclass(frozen=True, slots=True)
class Disturbance:
    """Standard deviation, N, and correlation time, s."""

    force_n: float
    correlation_s: float

    def courses(self, count: int, ticks: int, period_s: float, seed: int | list[int]) -> Floats:
        """`count` independent courses, (count, ticks), N; the same seed gives the same courses.

        >>> course = Disturbance(2.0, 0.05).courses(4, 50000, 0.001, seed=1)
        >>> bool(abs(course.std() - 2.0) < 0.2)
        True
        """
        keep = float(np.exp(-period_s / self.correlation_s))
        white = np.random.default_rng(seed).standard_normal((count, ticks))
        white[:, 0] /= np.sqrt(1.0 - keep * keep)  # starts in its stationary state
        return np.asarray(self.force_n * lfilter([np.sqrt(1.0 - keep * keep)], [1.0, -keep], white, axis=1))
