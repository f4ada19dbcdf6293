"""Identifies the spindle's heat: C dT/dt = α load rpm² + β rpm − (T − T_ambient)/R.

From temperatures alone, (α, β, 1/R, C) → (cα, cβ, c/R, cC) changes nothing: three combinations, α/C, β/C and R·C, are all that
can be known. The capacity stays as stated, and the other three are fitted with it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.heat.run import Warming, spindle_temperature_c, thermal_constants
from twin.identification.batch_fit import Fit, fit, time_blocks
from twin.machine import Thermal
from twin.simulator.recorded import start_temperature_c

Floats = NDArray[np.float64]
BLOCK_S = 120.0
NAMES = ("alpha_w_per_pct_rpm2", "beta_w_per_rpm", "resistance_k_per_w")


@dataclass(frozen=True, slots=True, eq=False)
class WarmingRun:
    """A recorded warm-up: what it was driven by, and the temperature, (n,), NaN where there is no sample."""

    t_s: Floats
    warming: Warming
    temperature_c: Floats

    @property
    def start_c(self) -> float:
        """Temperature at the first sample."""
        return start_temperature_c(self.t_s, self.temperature_c)


def fit_thermal(thermal: Thermal, runs: Sequence[WarmingRun], noise_k: float, relative: float) -> Fit:
    """Factors exp(θ) on α, β and R, from warm-up runs."""
    base = thermal_constants(thermal)
    free = [name for name in NAMES if base[name] > 0.0]

    def residuals(theta: Floats) -> Floats:
        constants = dict(base) | {name: base[name] * np.exp(theta[:, free.index(name)]) for name in free}
        parts = []
        for run in runs:
            modelled = spindle_temperature_c(constants, run.warming, run.start_c)
            there = np.isfinite(run.temperature_c)
            parts.append((modelled[:, there] - run.temperature_c[there]) / noise_k)
        return np.concatenate(parts, axis=1)

    blocks, first = [], 0
    for run in runs:
        block = time_blocks(run.t_s, BLOCK_S) + first
        blocks.append(block[np.isfinite(run.temperature_c)])
        first = int(block[-1]) + 1
    return fit(residuals, np.full(len(free), relative), np.full(len(free), 2.0), np.concatenate(blocks))


def with_thermal(thermal: Thermal, fitted: Fit) -> Thermal:
    """The heat with the identified constants."""
    stated = thermal.model_dump()
    free = [name for name in NAMES if stated[name] > 0.0]
    return thermal.model_copy(update={name: stated[name] * float(np.exp(t)) for name, t in zip(free, fitted.theta, strict=True)})
