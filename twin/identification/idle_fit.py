"""Identifies the idle power of a spindle from its load in air, as a control shows it once a second.

    P_idle = P_rated · load / 100,   the mean over the speeds

What the speeds differ by, the steps of the display and the noise of the readings are its uncertainty.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.gap.stages.air import AirRun
from twin.machine import SpindleDrive
from twin.simulator.recorded import resolution

SPEEDS = 50.0
"""rev/min within which two speeds are one."""
READINGS_MIN = 3


@dataclass(frozen=True, slots=True)
class Idle:
    """Idle power, kW, with one standard deviation."""

    power_kw: float
    deviation_kw: float


def fit_idle(spindle: SpindleDrive, runs: Sequence[AirRun]) -> Idle | None:
    """Return the idle power that the load in air shows; None where it shows too little, or none at all."""
    if sum(len(run.load) for run in runs) < READINGS_MIN:
        return None
    load, rpm = (np.concatenate([getattr(run, name) for run in runs]) for name in ("load", "rpm"))
    level = np.unique(np.round(rpm / SPEEDS), return_inverse=True)[1]
    count = np.bincount(level)
    means = np.bincount(level, load) / count
    within = float(np.sqrt(np.mean((load - means[level]) ** 2) / len(load)))
    between = float(np.std(means, ddof=1)) if len(means) > 1 else 0.0
    step = max(resolution(run.log["spindle_load_pct"]) for run in runs) / np.sqrt(12.0)
    kw_per_pct = spindle.rated_power_kw / 100.0
    mean = float(np.mean(means))
    return Idle(kw_per_pct * mean, kw_per_pct * float(np.hypot(np.hypot(within, between), step))) if mean > 0.0 else None
