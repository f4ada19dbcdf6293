"""The gain of a correction on time that was held out.

    gain = 1 − RMSE_corrected / RMSE_physics,    with the interval of a bootstrap over blocks of time (90 %)

Beside it stands the gain over a constant: the physics plus the mean residual of the training time. That is no model of anything,
it is a sensor or an ambient temperature that is off; a forest that does no better is not worth having.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.intervals import bootstrapped
from twin.residual.held_out import Interval

Floats = NDArray[np.float64]
Part = tuple[float, float]


def rmse(error: Floats) -> float:
    """Root mean square; NaN of nothing.

    >>> rmse(np.array([3.0, 4.0, 0.0, 0.0]))
    2.5
    """
    return float(np.sqrt(np.mean(error**2))) if len(error) else math.nan


def gain_of(before: Floats, after: Floats, block: NDArray[np.int64], seed: int = 0) -> Interval:
    """Gain of the errors `after` over those `before`, both (n,), of blocks (n,).

    >>> errors = np.array([2.0, -2.0, 2.0, -2.0])
    >>> str(gain_of(errors, errors / 2, np.array([0, 0, 1, 1])))
    '50 % (50 to 50)'
    """
    parts = [(float((before[block == one] ** 2).sum()), float((after[block == one] ** 2).sum())) for one in np.unique(block)]
    found = bootstrapped(parts, _gain, np.random.default_rng(seed))
    low, high = (found.low, found.high) if math.isfinite(found.low) else (-1.0, 1.0)
    value = found.value if math.isfinite(found.value) else 0.0
    return Interval(value=value, low=low, high=high)


def _gain(parts: Sequence[Part]) -> float:
    before, after = sum(part[0] for part in parts), sum(part[1] for part in parts)
    return 1.0 - math.sqrt(after / before) if before > 0.0 else math.nan
