"""An estimate: a figure, its interval, and whether the recordings can know it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.rotary import Letters, outside_name, outside_path, outside_unit

Floats = NDArray[np.float64]
INTERVAL_Z = 1.959963984540054
"""Half-width of a 95 % interval, in standard deviations."""
KNOWN_MIN = 0.5
"""Part of the information that has to come from the recordings; below it the stated value stays."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """One constant.

    path: as in machine.toml, or what it is; value in `unit`, with a 95 % interval low to high
    stated: what the machine description said, if it did
    known_by: part of the information that comes from the recordings, 0 to 1; the rest is the stated uncertainty
    """

    path: str
    value: float
    low: float
    high: float
    unit: str
    stated: float | None = None
    known_by: float = 1.0

    @property
    def identifiable(self) -> bool:
        """Return True where the recordings say more about it than was known before."""
        return self.known_by > KNOWN_MIN

    def in_own_units(self, rotary: Letters) -> "Estimate":
        """Return it in degrees and N m where it is of one of the rotary axes.

        >>> estimate = Estimate("axes.b.friction.viscous_n_s_per_mm", 2.0, 1.9, 2.1, "N·s/mm", 2.0).in_own_units({"b": 1.0})
        >>> estimate.path, round(estimate.value, 4), estimate.unit
        ('axes.b.friction.viscous_nm_s_per_deg', 0.1146, 'N m s/deg')
        """
        path = outside_path(self.path, rotary)
        if path == self.path:
            return self
        factor = outside_name(self.path, rotary.get(self.path.split(".")[1], 1.0))[1]
        value, low, high = (figure / factor for figure in (self.value, self.low, self.high))
        stated = None if self.stated is None else self.stated / factor
        return Estimate(path, value, low, high, outside_unit(self.unit)[0], stated, self.known_by)

    def sentence(self) -> str:
        """In words.

        >>> Estimate("axes.x.mass_kg", 326.4, 325.0, 327.8, "kg", 320.0).sentence()
        'axes.x.mass_kg = 326.4 kg (325 to 327.8; stated 320)'
        """
        stated = "" if self.stated is None else f"; stated {self.stated:.4g}"
        unsure = "" if self.identifiable else "; these recordings do not say, the stated uncertainty does"
        return f"{self.path} = {self.value:.4g} {self.unit} ({self.low:.4g} to {self.high:.4g}{stated}{unsure})"


def clustered_covariance(jacobian: Floats, residuals: Floats, blocks: NDArray[np.intp], prior_precision: Floats) -> Floats:
    """Covariance of a weighted least-squares fit whose residuals are correlated in time, (p, p).

    The sandwich estimator clustered by blocks, H⁻¹ (Σ_b g_b g_bᵀ + P) H⁻¹ with g_b = J_bᵀ r_b and H = JᵀJ + P, which does not
    take neighbouring samples for independent ones (Liang and Zeger 1986, Biometrika 73(1); Cameron and Miller 2015, J. Human
    Resources 50(2)), and is never below what independent residuals would give.

    jacobian: (n, p); residuals: (n,), in units of their noise; blocks: (n,) number of the block of each; prior_precision: (p, p)
    """
    hessian = jacobian.T @ jacobian + prior_precision
    count = int(blocks.max()) + 1 if len(blocks) else 1
    scores = np.zeros((count, jacobian.shape[1]))
    np.add.at(scores, blocks, jacobian * residuals[:, None])
    meat = scores.T @ scores * (count / max(count - 1, 1)) + prior_precision
    inverse = np.linalg.pinv(hessian, hermitian=True)
    clustered = inverse @ meat @ inverse
    scale = np.sqrt(np.maximum(1.0, np.diag(inverse) / np.maximum(np.diag(clustered), 1e-300)))
    return np.asarray(clustered * np.outer(scale, scale))
