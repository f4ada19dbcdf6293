"""Noise in the measured position and torque, which drive the open loop, does not bias what is fitted there: intervals cover."""

import numpy as np
from scipy.stats import binom

from tests.twin.gap.small_case import LEARN, MACHINE, axis_columns, case_of, plant
from tests.twin.gap.stages.open_loop.opened import loops_of_case
from twin.gap.diagnosis import Effected
from twin.gap.fitting import fitted
from twin.gap.intervals import Z90
from twin.gap.stages.stage import Model
from twin.machine import AddedEffect
from twin.simulator.simulation import simulate

SEEDS = 20
KNOWN_TORQUE = MACHINE.model_copy(update={"uncertainty": {"relative": 0.03, "axes.z.torque_constant_nm_per_a": 0.0}})
TRUE = {"mass_kg": np.log(256.0 / 260.0), "coulomb_n": np.log(309.0 / 300.0), "viscous_n_s_per_mm": np.log(1.96 / 2.0)}
FORCE_N = 80.0


def test_90_percent_intervals_of_mass_friction_and_gravity_cover() -> None:
    covered = dict.fromkeys((*TRUE, "gravity"), 0)
    real = plant((AddedEffect(effect="gravity", on="z", parameters={"force_n": FORCE_N}),))
    for seed in range(SEEDS):
        log = simulate(real, LEARN, seed=100 + seed).run
        stage = loops_of_case(case_of(KNOWN_TORQUE, {"fit": axis_columns(log)}))["mechanics"]
        model = Model(stage.constants, (Effected("gravity", "z"),))
        found = fitted(stage, model, model.null_theta())
        half = Z90 * np.sqrt(np.diag(found.covariance))
        for i, free in enumerate(model.free):
            name = free.name.partition("__")[0]
            if name in covered:
                true = TRUE.get(name, free.theta_of(FORCE_N) if name == "gravity" else 0.0)
                covered[name] += bool(abs(found.theta[i] - true) <= half[i])
    # fewer than this come once in a thousand times from intervals that cover 85 %
    least = int(binom.ppf(0.001, SEEDS, 0.85))
    assert all(count >= least for count in covered.values()), covered
