"""Nonlinear least squares over a simulator that runs many candidates at once.

    min Σ ρ(r_i(θ)²) + Σ (θ_j / σ_j)²,   ρ(z) = 2 f² (√(1 + z / f²) − 1),  f = 3 standard deviations

scipy's trust-region search does the steps; all finite differences of a step are one batch. The stated uncertainty of a parameter
is its prior. A parameter that the recordings tell less of than the prior is held at 0, which is what was stated, and the others
are fitted once more beside it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from twin.identification.estimate import KNOWN_MIN, clustered_covariance

Floats = NDArray[np.float64]
Residuals = Callable[[Floats], Floats]
STEP = 1e-4
OUTLIER = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """The result of the fit.

    theta: (p,); covariance: (p, p); known: (p,) part of the information that comes from the recordings, 0 to 1
    rms: of the residuals, in units of their noise; evaluations: simulated candidates
    """

    theta: Floats
    covariance: Floats
    known: Floats
    rms: float
    evaluations: int


def fit(residuals: Residuals, sigma: Floats, limit: Floats, blocks: NDArray[np.intp], start: Floats | None = None) -> Fit:
    """Fits p parameters.

    residuals: θ (candidates, p) → (candidates, n), in units of their noise; sigma: (p,) of the priors around 0
    limit: (p,) largest |θ|; blocks: (n,) time block of each residual (`clustered_covariance`)
    """
    evaluations = 0
    count = len(sigma)

    def with_prior(theta: Floats) -> Floats:
        nonlocal evaluations
        evaluations += 1
        return np.concatenate([residuals(theta[None, :])[0], theta / sigma])

    def jacobian(theta: Floats) -> Floats:
        nonlocal evaluations
        evaluations += 2 * count
        moves = STEP * np.diag(np.minimum(1.0, sigma * 100.0))
        both = residuals(np.concatenate([theta + moves, theta - moves]))
        slope = (both[:count] - both[count:]).T / (2.0 * np.diag(moves))
        return np.concatenate([slope, np.diag(1.0 / sigma)])

    begin = np.zeros(count) if start is None else start
    found = least_squares(with_prior, begin, jacobian, bounds=(-limit, limit), loss="soft_l1", f_scale=OUTLIER, xtol=1e-10)
    data = slice(0, len(found.fun) - count)
    # the weights of the robust loss at the solution: what is far off counts less, in the interval as in the fit
    weight = (1.0 + (found.fun[data] / OUTLIER) ** 2) ** -0.25
    slope = jacobian(found.x)[data] * weight[:, None]
    covariance = clustered_covariance(slope, found.fun[data] * weight, blocks, np.diag(1.0 / sigma**2))
    information = slope.T @ slope + np.diag(1.0 / sigma**2)
    known = 1.0 - np.clip(np.diag(np.linalg.pinv(information, hermitian=True)) / sigma**2, 0.0, 1.0)
    done = Fit(found.x, covariance, known, float(np.sqrt(np.mean(found.fun[data] ** 2))), evaluations)
    return done if np.all(known > KNOWN_MIN) else _held(done, residuals, sigma, limit, blocks)


def _held(found: Fit, residuals: Residuals, sigma: Floats, limit: Floats, blocks: NDArray[np.intp]) -> Fit:
    """Return the fit with what the recordings do not tell at what was stated, and its stated uncertainty."""
    free = found.known > KNOWN_MIN
    theta, covariance = np.zeros(len(sigma)), np.diag(sigma**2)
    if not free.any():
        return replace(found, theta=theta, covariance=covariance)

    def with_held(told: Floats) -> Floats:
        every = np.zeros((len(told), len(sigma)))
        every[:, free] = told
        return residuals(every)

    again = fit(with_held, sigma[free], limit[free], blocks, np.clip(found.theta[free], -limit[free], limit[free]))
    theta[free] = again.theta
    covariance[np.ix_(free, free)] = again.covariance
    return replace(found, theta=theta, covariance=covariance, rms=again.rms, evaluations=found.evaluations + again.evaluations)


def time_blocks(t_s: Floats, block_s: float) -> NDArray[np.intp]:
    """Number of the time block of each sample, (n,)."""
    return ((t_s - t_s[:1]) / block_s).astype(np.intp)
