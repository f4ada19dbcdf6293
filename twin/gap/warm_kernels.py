"""Compiles what the diagnosis of a production recording needs, ahead of the first one: its kernels are kept on this computer.

The heat and the load meter with all their effects and a learned term, the sensor with each effect that a sensor can have and with
the pairs that are found together, and the planner that times a program.
"""

from itertools import combinations

import numpy as np

from twin.effects.catalogue import catalogue
from twin.effects.effect import Effect, On
from twin.gap.stages.cut import acting
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants, thermal_quantities
from twin.machine import Program, SpindleDrive, Thermal
from twin.motion.path import path_from_moves
from twin.motion.plan import plan
from twin.programs import Settings, interpret
from twin.sensor.reading import readings
from twin.spindle.load import spindle_constants, spindle_load_pct, spindle_quantities

PROGRAM = "G21 G90 G17\nT1 M6\nS3000 M3\nG0 X10 Z5\nG1 X20 F1000\nX20 Y10\nG2 X30 Y20 I10 J0\nM5\nM30\n"


def warm_kernels() -> None:
    """Compile the kernels of a production diagnosis; quick where they are there already."""
    _heat()
    _load()
    _sensors()
    plan(
        path_from_moves(interpret(PROGRAM, Settings(dialect="fanuc"))),
        Program(rapid_mm_min=24000.0, acceleration_mm_s2=4000.0, jerk_mm_s3=8e4),
    )


def _constants(effects: tuple[Effect, ...]) -> dict[str, float]:
    """The constants of effects that are not there."""
    return {f"{effect.name}__{name}": value for effect in effects for name, value in effect.null_values().items()}


def _heat() -> None:
    thermal = Thermal(alpha_w_per_pct_rpm2=1e-8, beta_w_per_rpm=0.01, resistance_k_per_w=0.2, capacity_j_per_k=5000.0)
    effects = acting(thermal_quantities())
    constants = {**thermal_constants(thermal), **_constants(effects)}
    warming = Warming([0.0, 1.0], 10.0, 1000.0, 20.0)
    for added_w in (None, np.zeros(2)):
        spindle_temperature_c(constants, warming, 20.0, effects=tuple(e.name for e in effects), added_w=added_w)


def _load() -> None:
    drive = SpindleDrive(rated_power_kw=10.0, efficiency=0.85, idle_power_kw=0.3)
    effects = acting(spindle_quantities())
    constants = {**spindle_constants(drive), **_constants(effects)}
    spindle_load_pct(spindle_constants(drive), [0.0, 0.0], 1000.0)
    for added_kw in (None, np.zeros(2)):
        spindle_load_pct(constants, [0.0, 0.0], 1000.0, effects=tuple(e.name for e in effects), added_kw=added_kw)


def _sensors() -> None:
    there = [effect for effect in catalogue().values() if effect.on is On.SIGNAL]
    for some in (*combinations(there, 1), *combinations(there, 2)):
        readings(np.array([20.0, 20.1]), np.array([0.0, 1.0]), {effect.name: effect.typical_values() for effect in some})
