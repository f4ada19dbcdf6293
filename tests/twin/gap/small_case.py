"""Small cases: one axis of a machine that is a few percent off what its file states, moved for six seconds, three times."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.case import Case, Run, RunAtHand, RunEntry, RunKind
from twin.learned.section import LearnedSection
from twin.machine import AddedEffect, MachineFile, Thermal, machine_from_toml
from twin.runlog import RunLog, run_log
from twin.simulator.response import RunInput, respond
from twin.simulator.simulation import simulate

Floats = NDArray[np.float64]

MACHINE = machine_from_toml(
    """
[machine]
name = "small"
[axes.z]
mass_kg = 260.0
screw_lead_mm = 10.0
torque_constant_nm_per_a = 1.5
position_gain_per_s = 40.0
velocity_gain_a_s_per_mm = 0.20
velocity_integral_gain_a_per_mm = 6.0
torque_limit_a = 70.0
[axes.z.friction]
coulomb_n = 300.0
static_n = 420.0
stribeck_velocity_mm_s = 6.0
viscous_n_s_per_mm = 2.0
[program]
rapid_mm_min = 18000.0
acceleration_mm_s2 = 2500.0
jerk_mm_s3 = 60000.0
[uncertainty]
relative = 0.03
[noise]
position_mm = 0.0003
table_mm = 0.0003
torque_a = 0.01
"""
)
LEARN = "G4 P200\nG1 Z20 F6000\nG1 Z5 F1500\nG4 P400\nG1 Z8 F300\nG0 Z40\nG4 P400\nG1 Z30 F3000\nG1 Z0 F9000\nG4 P400\nM30\n"
JUDGE = "G4 P300\nG1 Z12 F2400\nG0 Z45\nG4 P400\nG1 Z42 F500\nG1 Z10 F7000\nG1 Z16 F1000\nG4 P400\nG0 Z0\nG4 P400\nM30\n"


def plant(effects: tuple[AddedEffect, ...] = (), machine: MachineFile = MACHINE) -> MachineFile:
    """The machine as it really is: constants a little off, a disturbance, and these effects."""
    axis = machine.axes["z"]
    friction = axis.friction.model_copy(update={"coulomb_n": 309.0, "static_n": 424.0, "viscous_n_s_per_mm": 1.96})
    axis = axis.model_copy(update={"mass_kg": 256.0, "friction": friction})
    noise = dict(machine.noise) | {"disturbance_force_n": 1.0, "disturbance_correlation_s": 0.035}
    return machine.model_copy(update={"axes": {"z": axis}, "noise": noise, "effects": effects})


def air_case(
    *effects: AddedEffect,
    machine: MachineFile = MACHINE,
    learned: tuple[LearnedSection, ...] = (),
    learn: str = LEARN,
    judge: str = JUDGE,
) -> Case:
    """Two runs of one program to learn from, one of another program to be judged on. learned: terms of the real machine"""
    real = plant(effects).model_copy(update={"learned": learned})
    runs = {
        name: (simulate(real, text, seed=seed).run, role, repeats)
        for seed, (name, text, role, repeats) in enumerate(
            (("fit", learn, "fit", None), ("fit again", learn, "fit", "fit"), ("check", judge, "check", None))
        )
    }
    return case_of(machine, {name: axis_columns(log) for name, (log, _, _) in runs.items()})


def axis_columns(log: RunLog) -> dict[str, Floats]:
    """Those of the axis."""
    return {"t_s": log.t_s} | {name: values for name, values in log.columns.items() if name.startswith("z_")}


def case_of(machine: MachineFile, columns: Mapping[str, Mapping[str, Floats]], kind: RunKind = RunKind.AIR) -> Case:
    """`fit`, `fit again` (which repeats it) and `check` from their columns; runs of other names are to be learned from."""
    runs = []
    for name, own in columns.items():
        repeats = "fit" if name == "fit again" and "fit" in columns and kind is RunKind.AIR else None
        entry = RunEntry(file=name, kind=kind, role="check" if name == "check" else "fit", repeats=repeats)
        runs.append(RunAtHand(entry, Path(), run_log(own, name)))
    return Case("small", machine, tuple(runs))


def columns_of(case: Case) -> dict[str, dict[str, Floats]]:
    """The columns of each run of a case, copied, to be mutilated."""
    return {run.name: {"t_s": run.log.t_s.copy()} | {n: v.copy() for n, v in run.log.columns.items()} for run in case.runs}


def changed(run: Run, log: RunLog) -> RunAtHand:
    """The run with another recording."""
    return RunAtHand(run.entry, run.folder, log)


HOT = MachineFile(
    machine=MACHINE.machine,
    thermal=Thermal(alpha_w_per_pct_rpm2=2.2e-8, beta_w_per_rpm=0.016, resistance_k_per_w=0.12, capacity_j_per_k=9000.0),
    uncertainty={"relative": 0.03},
    noise={"spindle_temp_c": 0.08},
)


def warm_case(*effects: AddedEffect, coolant: bool = False) -> Case:
    """The spindle warms up, cools down and warms up again, for an hour and a half, at three sets of speeds.

    coolant: it is switched on and off every ten minutes
    """
    columns = {}
    for seed, name in enumerate(("fit", "fit again", "check")):
        draw = np.random.default_rng(seed)
        t_s = np.arange(0.0, 5400.0, 2.0)
        rpm, load = (np.repeat(draw.uniform(low, high, 9), 300)[: len(t_s)] for low, high in ((2e3, 1e4), (5.0, 60.0)))
        rpm[(t_s > 3000.0) & (t_s < 4200.0)] = load[(t_s > 3000.0) & (t_s < 4200.0)] = 0.0
        ambient = np.full(len(t_s), 21.0)
        thermal = (
            HOT.thermal.model_copy(update={"resistance_k_per_w": 0.122, "capacity_j_per_k": 8900.0}) if HOT.thermal else None
        )
        coolant_on = (t_s // 600.0 % 2.0) * coolant
        told = RunInput(t_s, spindle_rpm=rpm, coolant_on=coolant_on, ambient_temp_c=ambient, start_temp_c=21.0)
        real = HOT.model_copy(update={"thermal": thermal, "effects": effects})
        shown = respond(real, told, recorded={"spindle_load_pct": load}, seed=seed).columns["spindle_temp_c"]
        columns[name] = {"t_s": t_s, "spindle_rpm": rpm, "spindle_load_pct": load, "ambient_temp_c": ambient}
        columns[name] |= {"spindle_temp_c": shown} | ({"coolant_on": coolant_on} if coolant else {})
    return case_of(HOT, columns, RunKind.WARMUP)
