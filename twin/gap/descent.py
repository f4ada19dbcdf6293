"""Nonlinear least squares over a simulator that runs many candidates at once: Levenberg–Marquardt, several dampings a step.

    min Σ ρ(r_i(θ)²) + Σ (θ_j / σ_j)²,   ρ(z) = 2 f² (√(1 + z / f²) − 1),   low ≤ θ ≤ high

Each iteration costs two batches: the slopes (one lane for each free number) and one trial for each damping, of which the best is
kept. The normal equations are small, so nothing tall is ever decomposed. Free numbers at a bound that the step would leave are
held for that step (projected Newton: Bertsekas 1982, SIAM J. Control and Optimization 20(2)).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twin.identification.estimate import clustered_covariance

Floats = NDArray[np.float64]
Residuals = Callable[[Floats], Floats]
OUTLIER = 3.0
DAMPINGS = (1e-4, 1e-2, 0.3, 10.0)
STEP = 2e-4


@dataclass(frozen=True, slots=True, eq=False)
class Bounds:
    """Bounds of θ, and the standard deviations of its prior around 0, (p,) each."""

    sigma: Floats
    low: Floats
    high: Floats


@dataclass(frozen=True, eq=False)
class Minimum:
    """The end of a descent. here: (n,) residuals there; evaluations: candidates.

    Most minima are only compared by what they leave, so slopes there are worked out where somebody asks how sure θ is.
    told: residuals that say so, where those that were minimised stand still within the steps of a reading
    """

    theta: Floats
    cost: float
    evaluations: int
    here: Floats
    residuals: Residuals
    bounds: Bounds
    blocks: NDArray[np.intp]
    slope_step: float
    told: Residuals | None = None

    @property
    def covariance(self) -> Floats:
        """Covariance of θ, (p, p)."""
        return self._sure[0]

    @property
    def known(self) -> Floats:
        """Part of what is known of θ that comes from the data, (p,), 0 to 1."""
        return self._sure[1]

    @cached_property
    def _sure(self) -> tuple[Floats, Floats]:
        told = self.told or self.residuals
        here = self.here if self.told is None else told(self.theta[None, :])[0]
        slopes = _slopes(told, self.theta, here, self.bounds, self.slope_step)
        weight = (1.0 + (here / OUTLIER) ** 2) ** -0.25
        prior = np.diag(1.0 / self.bounds.sigma**2)
        weighted = slopes * weight[:, None]
        covariance = clustered_covariance(weighted, here * weight, self.blocks, prior)
        information = weighted.T @ weighted + prior
        variance = np.diag(np.linalg.pinv(information, hermitian=True))
        return covariance, 1.0 - np.clip(variance / self.bounds.sigma**2, 0.0, 1.0)


def descend(
    residuals: Residuals,
    bounds: Bounds,
    blocks: NDArray[np.intp],
    start: Floats,
    *,
    steps_max: int = 30,
    tolerance: float = 1e-4,
    slope_step: float = STEP,
) -> Minimum:
    """Descend from `start` to a minimum.

    residuals: θ (candidates, p) → (candidates, n) in units of their noise; blocks: (n,) time block of each residual
    tolerance: relative decrease of the cost at which the search ends; slope_step: of θ, for its slopes
    """
    theta = np.clip(start, bounds.low, bounds.high)
    here = residuals(theta[None, :])[0]
    cost, evaluations = _cost(here, theta, bounds), 1
    for _ in range(steps_max if len(theta) else 0):
        slopes = _slopes(residuals, theta, here, bounds, slope_step)
        trials = np.stack([_step(slopes, here, theta, bounds, damping) for damping in DAMPINGS])
        shown = residuals(trials)
        evaluations += len(theta) + len(trials)
        costs = [_cost(r, t, bounds) for r, t in zip(shown, trials, strict=True)]
        best = int(np.argmin(costs))
        gain = cost - costs[best]
        if gain <= 0.0:
            break
        theta, here, cost = trials[best], shown[best], costs[best]
        if gain < tolerance * (cost + gain):
            break
    return Minimum(theta, cost, evaluations, np.array(here), residuals, bounds, blocks, slope_step)


def _cost(residual: Floats, theta: Floats, bounds: Bounds) -> float:
    robust = 2.0 * OUTLIER**2 * (np.sqrt(1.0 + (residual / OUTLIER) ** 2) - 1.0)
    return float(robust.sum() + np.sum((theta / bounds.sigma) ** 2))


def _slopes(residuals: Residuals, theta: Floats, here: Floats, bounds: Bounds, step: float) -> Floats:
    """(n, p), by differences towards the middle of the bounds."""
    if not len(theta):
        return np.zeros((len(here), 0))
    inward = np.where(theta > 0.5 * (bounds.low + bounds.high), -1.0, 1.0)
    moves = inward * step * np.maximum(1.0, np.abs(theta)) * np.minimum(1.0, 100.0 * bounds.sigma)
    shown = residuals(theta + np.diag(moves))
    return np.asarray((shown - here).T / moves)


def _step(slopes: Floats, here: Floats, theta: Floats, bounds: Bounds, damping: float) -> Floats:
    weight = 1.0 / np.sqrt(1.0 + (here / OUTLIER) ** 2)
    weighted = slopes * weight[:, None]
    hessian = slopes.T @ weighted + np.diag(1.0 / bounds.sigma**2)
    gradient = weighted.T @ here + theta / bounds.sigma**2
    free = ~(((theta <= bounds.low) & (gradient > 0.0)) | ((theta >= bounds.high) & (gradient < 0.0)))
    for _ in range(len(theta)):
        index = np.flatnonzero(free)
        if not len(index):
            return theta
        part = hessian[np.ix_(index, index)]
        move = np.zeros(len(theta))
        move[index] = -np.linalg.solve(part + damping * np.diag(np.diag(part)), gradient[index])
        out = free & (((theta + move) < bounds.low) | ((theta + move) > bounds.high))
        if not out.any():
            return np.asarray(theta + move)
        # those that would leave go to their bound, and the others are solved for again beside them
        held = np.clip(theta + move, bounds.low, bounds.high) - theta
        gradient = gradient + hessian[:, out] @ held[out]
        free &= ~out
        theta = np.where(out, theta + held, theta)
    return theta
