"""Points of the friction curve of an axis, from where it moved at a constant speed, and the curve through them.

At a constant speed nothing accelerates, so the mean force of the drive is friction and whatever else resists the motion:
F(v) = k · mean(torque). A force that does not depend on the direction, such as gravity, is in the points of both directions with
opposite signs.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar, nnls

from twin.identification.axis_fit import AxisRecording
from twin.machine import Axis
from twin.regimes import Regime

Floats = NDArray[np.float64]
SETTLED = 4.0
"""Time constants of the position loop until its transient is forgotten: e⁻⁴ = 2 % are left."""
SPEED_SPREAD_MAX = 0.01
"""Part of the speed by which it may differ within a stretch."""
SAMPLES_MIN = 20
GRID = 25


@dataclass(frozen=True, slots=True)
class FrictionPoint:
    """speed_mm_s: signed, of the reference; force_n: signed, mean of the drive over `samples` of them."""

    speed_mm_s: float
    force_n: float
    samples: int


@dataclass(frozen=True, slots=True)
class FrictionCurve:
    """F = F_c + (F_s − F_c) exp(−(v / v_s)²) + μ v of one direction."""

    coulomb_n: float
    static_n: float
    stribeck_velocity_mm_s: float
    viscous_n_s_per_mm: float


def friction_points(recording: AxisRecording, axis: Axis) -> tuple[FrictionPoint, ...]:
    """A point for each stretch of constant speed of a run without a cut, once the loop has settled on it."""
    period_s = float(np.median(np.diff(recording.t_s)))
    settling = round(SETTLED / (axis.position_gain_per_s * period_s))
    speed = np.gradient(recording.reference_mm, period_s)
    regimes = recording.regimes()
    constant = (regimes == Regime.CONSTANT_MINUS) | (regimes == Regime.CONSTANT_PLUS)
    turns = np.concatenate([[True], (np.sign(speed[1:]) != np.sign(speed[:-1])) | (constant[1:] != constant[:-1]), [True]])
    edges = np.flatnonzero(turns)
    points = []
    for first, last in pairwise(edges.tolist()):
        here = slice(first + settling, last)
        if not constant[first] or last - first - settling < SAMPLES_MIN:
            continue
        mean = float(speed[here].mean())
        torque = recording.torque_a[here]
        if np.ptp(speed[here]) <= SPEED_SPREAD_MAX * abs(mean) and np.isfinite(torque).all():
            points.append(FrictionPoint(mean, axis.newton_per_command * float(torque.mean()), len(torque)))
    return tuple(points)


def fit_friction_curve(speed_mm_s: Floats, force_n: Floats) -> tuple[FrictionCurve, int]:
    """The curve of least squares through points of one direction, magnitudes (n,), and how many curves were solved for.

    F_c, F_s − F_c and μ are linear for a given v_s, and none of them is below 0, so only v_s is searched for (variable
    projection: Golub, Pereyra 1973, SIAM J. Numer. Anal. 10(2)): on a grid, since there may be several valleys, then by Brent's
    method. It lies within the speeds: what falls off below the slowest one leaves nothing in the points, F_s would be whatever.

    >>> speed = np.array([1.0, 2.0, 5.0, 10.0, 30.0, 100.0])
    >>> curve, _ = fit_friction_curve(speed, 380.0 + 140.0 * np.exp(-((speed / 6.0) ** 2)) + 2.4 * speed)
    >>> round(curve.coulomb_n, 3), round(curve.static_n, 3), round(curve.stribeck_velocity_mm_s, 3)
    (380.0, 520.0, 6.0)
    """

    def solved(log_stribeck: float) -> tuple[Floats, float]:
        columns = [np.ones_like(speed_mm_s), np.exp(-((speed_mm_s / np.exp(log_stribeck)) ** 2)), speed_mm_s]
        linear, norm = nnls(np.stack(columns, axis=1), force_n)
        return np.asarray(linear, dtype=np.float64), float(norm)

    grid = np.log(np.geomspace(speed_mm_s.min(), speed_mm_s.max(), GRID)).tolist()
    at_grid = [solved(at)[1] for at in grid]
    best = int(np.argmin(at_grid))
    around = (grid[max(best - 1, 0)], grid[min(best + 1, GRID - 1)])
    fine = minimize_scalar(lambda at: solved(float(at))[1], bounds=around, method="bounded", options={"xatol": 1e-9})
    at = float(fine.x) if fine.fun < at_grid[best] else grid[best]
    coulomb, more, viscous = (float(value) for value in solved(at)[0])
    return FrictionCurve(coulomb, coulomb + more, float(np.exp(at)), viscous), GRID + int(fine.nfev) + 1
