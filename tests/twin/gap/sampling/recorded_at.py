"""The small axis recorded at other times than those of its ticks: a drive samples what its loops do whenever it likes."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from tests.twin.gap.small_case import JUDGE, LEARN, MACHINE, case_of, plant
from twin.case import Case
from twin.machine import AddedEffect
from twin.runlog import RunLog
from twin.simulator.simulation import simulate

Floats = NDArray[np.float64]
TICK_S = 0.001


def recorded_at(log: RunLog, at_s: Floats, seed: int) -> dict[str, Floats]:
    """The columns of the axis at these times: positions go on between ticks, a torque is held until the next one."""
    chance = np.random.default_rng([seed, 7])
    before = np.clip(np.floor(at_s / TICK_S + 1e-6).astype(int), 0, len(log) - 1)
    columns = {"t_s": at_s}
    for name in ("z_ref_mm", "z_pos_mm", "z_table_mm"):
        columns[name] = CubicSpline(log.t_s, log[name])(at_s)
    still = np.append(np.diff(log["z_ref_mm"]) == 0.0, True)[before]
    columns["z_ref_mm"] = np.where(still, log["z_ref_mm"][before], columns["z_ref_mm"])
    columns["z_torque_a"] = log["z_torque_a"][before] + 0.01 * chance.standard_normal(len(at_s))
    for name in ("z_pos_mm", "z_table_mm"):
        columns[name] = columns[name] + 0.0003 * chance.standard_normal(len(at_s))
    return columns


def case_recorded_every(sample_s: float, *effects: AddedEffect, jitter_s: float = 0.0) -> Case:
    """The case of `air_case` recorded at another sample period, each sample taken up to `jitter_s` early or late."""
    real = plant(effects)
    real = real.model_copy(update={"noise": dict(real.noise) | {"position_mm": 0.0, "table_mm": 0.0, "torque_a": 0.0}})
    columns = {}
    for seed, (name, text) in enumerate((("fit", LEARN), ("fit again", LEARN), ("check", JUDGE))):
        log = simulate(real, text, seed=seed).run
        at_s = np.arange(0.0, log.t_s[-1], sample_s)
        at_s = np.sort(np.abs(at_s + jitter_s * np.random.default_rng(seed).uniform(-1.0, 1.0, len(at_s))))
        columns[name] = recorded_at(log, at_s - at_s[0], seed)
    return case_of(MACHINE, columns)
