"""Recordings that are made up in a moment: a spindle with a second mass behind it, and one whose residual nothing explains."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from twin.residual.features import AMBIENT, FEED, LOAD, MEASURED, PHYSICS, POSITIONS, SPEED
from twin.residual.model import Trained
from twin.residual.physics import Physics
from twin.residual.recorded_run import Samples, recorded_of
from twin.residual.table import Recorded
from twin.residual.training import Outcome, TrainingSettings, trained

Floats = NDArray[np.float64]
PHYSICS_TOLD = Physics(alpha_w_per_pct_rpm2=2.2e-8, beta_w_per_rpm=1.6e-2, resistance_k_per_w=0.16, capacity_j_per_k=4000.0)
TICK_S = 30.0
SMALL = TrainingSettings(trees=8, depth_max=10, row_s=60.0)


def samples(hours: float, seed: int = 1, speed: float = 1.0) -> dict[str, Samples]:
    """Signals of a machine that cuts, pauses, cuts: a sample every 30 s; no temperature of the spindle."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, hours * 3600.0, TICK_S)
    runs = np.repeat(rng.uniform(size=len(t_s) // 40 + 1) < 0.7, 40)[: len(t_s)]
    program = np.repeat(rng.integers(1, 5, len(t_s) // 40 + 1), 40)[: len(t_s)]
    values = {
        SPEED: runs * program * 2000.0 * speed,
        LOAD: np.round(runs * (10.0 + 5.0 * program + rng.normal(0.0, 1.0, len(t_s))), 1),
        FEED: runs * 800.0 * (1.0 + rng.uniform(size=len(t_s))),
        AMBIENT: np.round(21.0 + np.sin(t_s / 20_000.0), 1),
    }
    values |= {name: rng.uniform(-200.0, 200.0, len(t_s)) for name in POSITIONS}
    return {name: Samples(t_s, value) for name, value in values.items()}


@cache
def recorded(hours: float = 60.0, seed: int = 1, speed: float = 1.0) -> Recorded:
    """Return what the physics lacks is a second mass: −0.4 of the rise, and back, with 2 h."""
    told = samples(hours, seed, speed)
    start = {**told, MEASURED: Samples(told[SPEED].t_s[:1], np.array([told[AMBIENT].value[0]]))}
    plain = recorded_of(start, PHYSICS_TOLD, TICK_S)
    rise = plain.signals[PHYSICS] - plain.signals[AMBIENT]
    share, mean = 1.0 - np.exp(-TICK_S / 7200.0), 0.0
    behind = np.empty(len(rise))
    for place, value in enumerate(rise.tolist()):
        mean += share * (value - mean)
        behind[place] = -0.4 * (value - mean)
    noise = np.random.default_rng(seed + 100).normal(0.0, 0.03, len(rise))
    return with_residual(plain, behind + noise)


def wandering(seed: int, memory_s: float = 3600.0) -> Recorded:
    """A residual that wanders by itself, whatever the machine does."""
    plain = recorded()
    rng, kept = np.random.default_rng(seed), np.exp(-TICK_S / memory_s)
    value, found = rng.normal(), []
    for step in rng.normal(size=len(plain.t_s)).tolist():
        value = kept * value + np.sqrt(1.0 - kept**2) * step
        found.append(value)
    return with_residual(plain, np.array(found))


def with_residual(plain: Recorded, residual_k: Floats) -> Recorded:
    return Recorded(plain.t_s, plain.stretch, {**plain.signals, MEASURED: plain.signals[PHYSICS] + residual_k})


@cache
def small_model(seed: int = 1, feature_set: str = "") -> Outcome:
    about = Trained(machine="okuma", at="2026-01-01T00:00:00Z", source=("run.parquet",), physics=PHYSICS_TOLD)
    asked = TrainingSettings(SMALL.trees, SMALL.depth_max, SMALL.leaf_min, SMALL.row_s, feature_set=feature_set, seed=seed)
    return trained(recorded(), asked, about)
