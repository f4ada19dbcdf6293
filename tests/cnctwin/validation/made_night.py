"""Nights of which the truth is known: the simulated machine's spindle as built, beside the twin that knows its data sheet."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cnctwin.standins.simulated_machine.as_built import machine_as_built
from cnctwin.standins.simulated_machine.description import TOLD
from cnctwin.validation.model import Twin
from twin.machine import MachineFile, read_machine
from twin.runlog import RunLog, run_log
from twin.simulator.response import RunInput, respond

Floats = NDArray[np.float64]
START_S = 1_795_219_200.0
"""Midnight, 21 November 2026, UTC."""


def told_twin() -> Twin:
    """The live description of the simulated machine; the tables hold the same for processors without a description."""
    told = read_machine(TOLD)
    assert told.thermal is not None and told.spindle is not None
    return Twin(told, {"thermal": told.thermal.model_dump(), "cutting_force": told.spindle.model_dump()})


def changed_twin(**thermal: float) -> Twin:
    """With other constants of its heat."""
    told = told_twin().file
    assert told is not None and told.thermal is not None
    return Twin(told.model_copy(update={"thermal": told.thermal.model_copy(update=thermal)}), {})


def working_spindle(hours: float, every_s: float = 1.0, seed: int = 1) -> dict[str, Floats]:
    """Speed and load of parts that are made one after the other, with pauses and a break, (n,) each."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, 3600.0 * hours, every_s)
    rpm, load = np.zeros_like(t_s), np.full_like(t_s, 2.9)
    at_s = 0.0
    while at_s < t_s[-1]:
        length_s = rng.uniform(80.0, 110.0)
        cut = (t_s >= at_s) & (t_s < at_s + length_s)
        rpm[cut] = 8500.0
        load[cut] = 5.0 + rng.uniform(2.0, 12.0) + 2.0 * rng.standard_normal(int(cut.sum()))
        at_s += length_s + (600.0 if rng.random() < 0.05 else rng.uniform(8.0, 15.0))
    return {"t_s": t_s, "spindle_rpm": rpm, "spindle_load_pct": np.maximum(load, 0.0)}


def heated(machine: MachineFile, spindle: dict[str, Floats], start_c: float, noise_k: float, seed: int = 1) -> Floats:
    """The temperature that a machine's spindle really has, as a sensor shows it, (n,)."""
    bare = machine.model_copy(update={"axes": {}, "effects": ()})
    ambient = 21.5 + 0.5 * np.sin(spindle["t_s"] * np.pi / 1800.0)
    told = RunInput(spindle["t_s"], spindle_rpm=spindle["spindle_rpm"], ambient_temp_c=ambient, start_temp_c=start_c)
    truth = respond(bare, told, recorded={"spindle_load_pct": spindle["spindle_load_pct"]}).columns["spindle_temp_c"]
    return np.asarray(truth + noise_k * np.random.default_rng([seed, 9]).standard_normal(len(truth)))


def warm_night(hours: float = 6.0, at_s: float = 0.0, **more: Any) -> RunLog:
    """A run log of the machine as it was built: speed, load, surroundings, temperature."""
    spindle = working_spindle(hours)
    truth = heated(machine_as_built(), spindle, 23.0, 0.03)
    ambient = 21.5 + 0.5 * np.sin(spindle["t_s"] * np.pi / 1800.0)
    columns = {**spindle, "t_s": spindle["t_s"] + at_s, "spindle_temp_c": truth, "ambient_temp_c": ambient, **more}
    return run_log(columns, "night.parquet")
