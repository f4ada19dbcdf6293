"""A small rotary axis, in degrees and N m, and recordings of it as a drive writes them."""

import numpy as np
from numpy.typing import NDArray

from tests.twin.gap.small_case import case_of
from twin.case import Case
from twin.machine import MachineFile, machine_from_toml
from twin.simulator.response import RunInput, respond

Floats = NDArray[np.float64]

STATED = """
[machine]
name = "table"

[axes.b]
inertia_kg_m2 = 2.5
torque_per_command_nm = 12.0
position_gain_per_s = 25.0
velocity_gain_a_s_per_deg = 0.08
velocity_integral_gain_a_per_deg = 1.5
torque_limit_a = 30.0

[axes.b.friction]
coulomb_nm = 14.0
static_nm = [18.0, 18.5]
stribeck_velocity_deg_s = 2.0
viscous_nm_s_per_deg = 0.12

[uncertainty]
relative = 0.03
"axes.b.inertia_kg_m2" = 0.1

[noise]
position_deg = 0.0002
table_deg = 0.0003
torque_a = 0.01
disturbance_torque_nm = 0.05
"""
LEARN = ((30, 0.6), (-12, 0.6), (4, 0.6), (-60, 0.4), (60, 0.4), (-1.5, 0.8), (1.5, 0.5), (-20, 0.5))
JUDGE = ((45, 0.4), (-8, 0.7), (20, 0.5), (-50, 0.3), (2.5, 0.6), (-3, 0.5))


def reference_deg(strokes: tuple[tuple[float, float], ...]) -> Floats:
    """Strokes at so many deg/s for so many seconds, with rests between them and accelerations that begin softly."""
    speed = np.concatenate([np.zeros(300), *(np.r_[np.full(int(1000 * s), v), np.zeros(400)] for v, s in strokes)])
    for window in (151, 51):
        speed = np.convolve(speed, np.ones(window) / window)
    return np.cumsum(np.where(np.abs(speed) < 1e-9, 0.0, speed)) * 0.001


def recorded(machine: MachineFile, strokes: tuple[tuple[float, float], ...], seed: int, name: str = "b") -> dict[str, Floats]:
    """The columns that the machine records over these strokes, in degrees, of an axis of this name."""
    reference = reference_deg(strokes)
    t_s = np.arange(len(reference)) * 0.001
    answered = respond(machine, RunInput(t_s, {"b": reference}), seed=seed).columns
    return {
        "t_s": t_s,
        f"{name}_ref_deg": reference,
        f"{name}_pos_deg": answered["b_pos_mm"],
        f"{name}_table_deg": answered["b_table_mm"],
        f"{name}_torque_a": answered["b_torque_a"],
    }


def rotary_case(effects: str = "", stated: str = STATED, name: str = "b", every: int = 1) -> Case:
    """The table with these effects, and 2 % more inertia than stated, recorded three times.

    name: what its axis is called in the recordings and as stated; every: ticks from sample to sample
    """
    real = machine_from_toml(STATED.replace("inertia_kg_m2 = 2.5", "inertia_kg_m2 = 2.55") + effects)
    runs = (("fit", LEARN), ("fit again", LEARN), ("check", JUDGE))
    columns = {run: recorded(real, strokes, seed, name) for seed, (run, strokes) in enumerate(runs)}
    columns = {run: {column: values[::every] for column, values in own.items()} for run, own in columns.items()}
    return case_of(machine_from_toml(stated.replace("axes.b", f"axes.{name}")), columns)
