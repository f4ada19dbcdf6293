"""Constants of the machine that a fit has moved, and whether they could have stayed.

θ / σ is by how many stated deviations a constant has moved. Some have to be beyond two of them where a fit that may not go there
is worse on runs that neither was fitted to. What always shows as a product (mass, friction and torque constant of an axis in air)
is so moved together, as far as each may go, before any of them is said to be far off.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from twin.gap.evidence import advantage
from twin.gap.fitting import Fitted, fitted
from twin.gap.refitted import KNOWN_MIN
from twin.gap.stages.stage import Stage

Floats = NDArray[np.float64]
BEYOND, NEARLY = 2.0, 1.25
"""Stated deviations that are a finding, and the factor by which a constant may exceed them before its machine is not healthy: of
twenty constants that scatter as stated, one is beyond two."""
SIGMAS, CLOSES = 3.0, 0.05
"""Standard errors, and floors² of a signal, by which the fit within two deviations has to be the worse."""
CHANCE = 0.002
"""Part of machines whose constants are, all together, further from what is stated."""


def deviations(found: Fitted) -> Floats:
    """Return θ / σ of each constant, (constants,); 0 for one that the recordings do not tell."""
    sigma = np.array([free.sigma for free in found.model.constants])
    count = len(sigma)
    return np.asarray(np.where(found.known[:count] >= KNOWN_MIN, found.theta[:count] / sigma, 0.0))


def cost(found: Fitted) -> float:
    """Return Σ (θ / σ)² of the constants: what the stated machine says against them."""
    return float(np.sum(deviations(found) ** 2))


def has_to_be_beyond(stage: Stage, found: Fitted) -> bool:
    """Return True where the runs do not fit with every constant within two stated deviations, or only with most at them."""
    away, count = np.abs(deviations(found)), len(found.model.constants)
    if count and cost(found) > float(chi2.isf(CHANCE, count)):
        return True
    if not (away > NEARLY * BEYOND).any():
        return False
    over = advantage(_within(stage, found).left, found.left)
    return over.sigmas > SIGMAS and over.closes > CLOSES


def _within(stage: Stage, found: Fitted) -> Fitted:
    """The same hypothesis, fitted with every constant within two stated deviations."""
    narrow = tuple(
        replace(free, low=max(free.low, -BEYOND * free.sigma), high=min(free.high, BEYOND * free.sigma))
        for free in found.model.constants
    )
    model = replace(found.model, constants=narrow)
    scale = np.maximum(found.left_fit.rms(), 1.0)
    return fitted(stage, model, found.theta, scale=scale)
