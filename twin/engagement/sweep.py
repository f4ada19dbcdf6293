"""The sweep of one straight move of a flat end mill: the points within its radius of the move, down to the end face.

A sweep begins at (x₀, y₀, z₀) and goes the horizontal length L in the direction u, its end face at z(s) = z₀ + k s. A point q
with t = (q − p₀)·u along the move and d across it is reached at the positions s with |s − t| ≤ √(R² − d²) and 0 ≤ s ≤ L, and left
at the lowest z among them, at one end of that interval. It is an exact surface: no grid is involved.

A sweep is a row of 8 numbers, so that one row is one cache line.
"""

import math

import numpy as np
from numpy.typing import NDArray

from twin.kernels.compiling import kernel

Floats = NDArray[np.float64]

X, Y, Z, UX, UY, LENGTH, SLOPE, RADIUS = range(8)
COLUMNS = 8

RELATIVE_MARGIN = 2e-9
"""A point this close to the rim (relative, of R²) is not reached: the tool's own rim must not count as cut by the tool."""
WITHIN_MM = 1e-9
"""A sweep that another one contains but for this is contained."""


@kernel
def lowest_at(sweeps: Floats, k: int, x: float, y: float) -> float:
    """The z to which sweep `k` cuts at (x, y); inf where it does not reach."""
    dx, dy = x - sweeps[k, X], y - sweeps[k, Y]
    along = dx * sweeps[k, UX] + dy * sweeps[k, UY]
    across = dx * sweeps[k, UY] - dy * sweeps[k, UX]
    length, radius_squared = sweeps[k, LENGTH], sweeps[k, RADIUS] ** 2
    beyond = along if along < 0.0 else max(along - length, 0.0)
    if beyond * beyond + across * across >= radius_squared * (1.0 - RELATIVE_MARGIN):
        return math.inf
    slope = sweeps[k, SLOPE]
    if slope == 0.0:
        return float(sweeps[k, Z])
    half = math.sqrt(radius_squared - across * across)
    deepest = min(length, along + half) if slope < 0.0 else max(0.0, along - half)
    return float(sweeps[k, Z] + slope * deepest)


@kernel
def lowest_between(sweeps: Floats, k: int, low: float, high: float) -> float:
    """The lowest z of sweep `k` between the positions low and high along it."""
    slope, length = sweeps[k, SLOPE], sweeps[k, LENGTH]
    deepest = min(length, max(0.0, high if slope < 0.0 else low))
    return float(sweeps[k, Z] + slope * deepest)


@kernel
def highest_in_square(sweeps: Floats, k: int, x: float, y: float, side: float) -> float:
    """The highest z that sweep `k` leaves in the square with its lower left corner at (x, y); inf where it does not cover it.

    What is reached is convex and z is convex over it, so that the four corners decide.
    """
    highest = -math.inf
    for corner in range(4):
        highest = max(highest, lowest_at(sweeps, k, x + side * (corner & 1), y + side * (corner >> 1)))
        if highest == math.inf:
            break
    return highest


@kernel
def lowest_in_square(sweeps: Floats, k: int, x: float, y: float, side: float) -> float:
    """A bound: sweep `k` cuts no lower than this in the square with its lower left corner at (x, y)."""
    if sweeps[k, SLOPE] == 0.0:
        return float(sweeps[k, Z])
    half = side / 2.0
    along = (x + half - sweeps[k, X]) * sweeps[k, UX] + (y + half - sweeps[k, Y]) * sweeps[k, UY]
    reach = half * (abs(sweeps[k, UX]) + abs(sweeps[k, UY])) + sweeps[k, RADIUS]
    return lowest_between(sweeps, k, along - reach, along + reach)


@kernel
def contains(sweeps: Floats, new: int, old: int) -> bool:
    """True if sweep `new` leaves nothing of what sweep `old` removed: wherever that cut, this cuts as low or lower."""
    spare = sweeps[new, RADIUS] - sweeps[old, RADIUS] + WITHIN_MM
    if spare < 0.0:
        return False
    dx, dy = sweeps[old, X] - sweeps[new, X], sweeps[old, Y] - sweeps[new, Y]
    if abs(dx * sweeps[new, UY] - dy * sweeps[new, UX]) > spare:
        return False
    length = sweeps[new, LENGTH]
    for s in (0.0, sweeps[old, LENGTH]):
        ex, ey = dx + s * sweeps[old, UX], dy + s * sweeps[old, UY]
        along = ex * sweeps[new, UX] + ey * sweeps[new, UY]
        across = ex * sweeps[new, UY] - ey * sweeps[new, UX]
        beyond = along if along < 0.0 else max(along - length, 0.0)
        if beyond * beyond + across * across > spare * spare:
            return False
    highest = sweeps[new, Z] + max(0.0, sweeps[new, SLOPE] * length)
    return bool(highest <= lowest_between(sweeps, old, 0.0, sweeps[old, LENGTH]))
