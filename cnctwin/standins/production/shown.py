"""The display of a control: to what it rounds each signal."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Shown:
    """The step of each signal; 0 = as it is. A control commonly shows whole per cent, and tenths of a kelvin."""

    load_pct: float = 1.0
    temp_c: float = 0.1
    rpm: float = 1.0
    feed_mm_min: float = 1.0

    def shown(self, signal: str, values: Floats) -> Floats:
        """Return the values of a signal as the control shows them. A load is never negative.

        >>> Shown().shown("spindle_load_pct", np.array([3.4, 12.6, -0.3])).tolist()
        [3.0, 13.0, 0.0]
        """
        if signal == "spindle_load_pct":
            values = np.maximum(values, 0.0)
        step = self._step(signal)
        return np.round(np.round(values / step) * step, 9) if step else values

    def _step(self, signal: str) -> float:
        steps = {"spindle_load_pct": self.load_pct, "feed_mm_min": self.feed_mm_min}
        steps |= dict.fromkeys(("spindle_temp_c", "ambient_temp_c"), self.temp_c)
        steps |= dict.fromkeys(("spindle_rpm", "spindle_rpm_cmd"), self.rpm)
        return steps.get(signal, 0.0)


USUAL_DISPLAY = Shown()
