"""A low pass in the way of both forces: an amplifier, an anti-aliasing filter, or the table of the dynamometer itself.

    H(f) = 1 / (1 + 2 i D f/f₀ − (f/f₀)²)

It takes from the higher orders of a turn as a helix does, and no recording says that it is there.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class LowPass:
    """Second order. cutoff_hz: f₀; damping: D, 0.71 for the flattest pass band"""

    cutoff_hz: float
    damping: float

    @property
    def half_power_hz(self) -> float:
        """Frequency at which half of the power passes.

        >>> round(LowPass(100.0, 0.5**0.5).half_power_hz, 6)
        100.0
        """
        even = 1.0 - 2.0 * self.damping**2
        return float(self.cutoff_hz * np.sqrt(even + np.hypot(even, 1.0)))

    def passed(self, orders: Complexes, turn_hz: float) -> Complexes:
        """Return the orders of turns, (…, orders), behind it.

        >>> np.abs(LowPass(100.0, 0.5).passed(np.ones(3, dtype=complex), 100.0)).round(3).tolist()
        [1.0, 1.0, 0.277]
        """
        ratio = np.arange(orders.shape[-1]) * turn_hz / self.cutoff_hz
        return np.asarray(orders / (1.0 - ratio**2 + 2.0j * self.damping * ratio))
