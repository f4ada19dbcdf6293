"""The scores of one machine over one stretch, by tick."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Scores of one machine over one stretch, by tick. t_s: (T,); raw, adjusted: (T,), NaN = not known; gated: (T,)

    skipped: (T,) gated, or the spindle stands where that is not judged: neither evidence for an alarm nor against
    """

    t_s: Floats
    raw: Floats
    adjusted: Floats
    gated: NDArray[np.bool_]
    skipped: NDArray[np.bool_]
