"""Dynamic time warping of a found window against the whole template: does what lies between look right, too?

Both are brought to 96 points and to mean 0 and deviation 1. The distance is the root mean square along the cheapest warping
path (steps 1-1, 1-0, 0-1) within a band around the diagonal (Sakoe and Chiba 1978).
"""

import numpy as np
from numpy.typing import NDArray

from twin.kernels.compiling import kernel

Floats = NDArray[np.float64]
POINTS = 96
BAND = 34
"""Points: a stall of 4 s in a window of 14 s moves what is beside it by 27."""


@kernel
def shape_of(values: Floats) -> Floats:
    """(n,) as POINTS points, means of equal shares of it, of mean 0 and deviation 1; a flat one stays at 0."""
    n = len(values)
    points = np.zeros(POINTS)
    for i in range(POINTS):
        low, high = i * n / POINTS, (i + 1) * n / POINTS
        first, last = int(low), min(int(np.ceil(high)), n)
        total = 0.0
        for j in range(first, last):
            total += values[j] * (min(j + 1.0, high) - max(float(j), low))
        points[i] = total / (high - low)
    points -= points.mean()
    deviation = np.sqrt((points * points).mean())
    return points / deviation if deviation > 1e-12 else points * 0.0


@kernel
def warped_distance(left: Floats, right: Floats, band: int) -> float:
    """Root mean square distance of two shapes of equal length along the best path.

    >>> warped_distance(np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 1.0]), 1)
    0.0
    """
    n = len(left)
    cost = np.full((n + 1, n + 1), np.inf)
    steps = np.zeros((n + 1, n + 1))
    cost[0, 0] = 0.0
    for i in range(1, n + 1):
        for j in range(max(1, i - band), min(n, i + band) + 1):
            before, way = cost[i - 1, j - 1], steps[i - 1, j - 1]
            if cost[i - 1, j] < before:
                before, way = cost[i - 1, j], steps[i - 1, j]
            if cost[i, j - 1] < before:
                before, way = cost[i, j - 1], steps[i, j - 1]
            apart = left[i - 1] - right[j - 1]
            cost[i, j] = before + apart * apart
            steps[i, j] = way + 1.0
    return float(np.sqrt(cost[n, n] / steps[n, n]))
