"""Traces to look at: made up ones whose gap is known, and those of the shared cases."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.recordings import recordings_folder
from twin.case import Case, read_case
from twin.gap.diagnosis import Trace
from twin.gap.floors import repeatability
from twin.gap.labels import measured_signals, regime_labels
from twin.machine import MachineFile, machine_from_toml
from twin.runlog import RunLog, run_log
from twin.simulator.recorded import noise_of, told_of
from twin.simulator.response import respond

Floats = NDArray[np.float64]
MACHINE = machine_from_toml(
    """
[machine]
name = "made up"
[axes.x]
mass_kg = 320.0
screw_lead_mm = 12.0
torque_constant_nm_per_a = 1.2
position_gain_per_s = 40.0
velocity_gain_a_s_per_mm = 0.3
torque_limit_a = 60.0
friction = { coulomb_n = 380.0, static_n = 520.0, stribeck_velocity_mm_s = 6.0, viscous_n_s_per_mm = 2.4 }
[program]
rapid_mm_min = 6000.0
acceleration_mm_s2 = 2500.0
"""
)
UNITS = {"mm": "mm", "a": "A", "n": "N", "pct": "%", "c": "°C"}


def strokes(feeds_mm_min: tuple[float, ...] = (1200.0, 3000.0, 1800.0), length_mm: float = 40.0) -> RunLog:
    """A run of x at 1 kHz: there and back at each feed, 0.5 s of rest before each stroke and at the end; one NC line a stroke."""
    pieces: list[Floats] = []
    lines: list[Floats] = []
    at = 0.0
    for number, feed in enumerate(np.repeat(feeds_mm_min, 2)):
        speed = feed / 60.0
        ramp, ticks = speed / 2500.0, length_mm / speed + speed / 2500.0
        t_s = np.arange(0.0, ticks, 0.001)
        velocity = np.interp(t_s, [0.0, ramp, ticks - ramp, ticks], [0.0, speed, speed, 0.0])
        move = np.cumsum(velocity) * 0.001
        target = length_mm - at
        pieces += [np.full(500, at), at + (target - at) * move / move[-1]]
        lines += [np.full(500 + len(t_s), float(number + 1))]
        at = target
    pieces.append(np.full(500, at))
    lines.append(np.full(500, lines[-1][-1]))
    reference = np.concatenate(pieces)
    return run_log({"t_s": np.arange(len(reference)) * 0.001, "line": np.concatenate(lines), "x_ref_mm": reference})


def trace(log: RunLog, gap: Floats, signal: str = "x_torque_a", floor: float = 0.01, run: str = "run") -> Trace:
    """The trace of a signal that its twin misses by `gap`, (n,), and follows once the causes are in it."""
    names, label = regime_labels(log, signal, MACHINE)
    measured = np.sin(log.t_s)
    flat = np.full(len(log), floor)
    unit = UNITS[signal.rsplit("_", 1)[1]]
    return Trace(run, signal, unit, log.t_s, measured, measured + gap, measured, flat, label, names, False)


def noise(log: RunLog, seed: int, floor: float = 0.01) -> Floats:
    """Return what repeats: white noise of a floor, (n,)."""
    return floor * np.random.default_rng(seed).standard_normal(len(log))


def shared_case(name: str) -> Case:
    """One of the shared cases; the test is skipped where they are not there."""
    folder: Path = recordings_folder().parent / "cases" / name
    if not folder.exists():
        pytest.skip(f"no case {folder}; CNCTWIN_DATA names the folder of the recordings, the cases lie beside it")
    return read_case(folder)


def traces_of(case: Case, machine: MachineFile) -> tuple[tuple[Trace, ...], Mapping[str, RunLog]]:
    """The traces of the runs of a case that were not fitted, and their logs."""
    floors = repeatability(case.runs, case.repeats(), machine)
    traces, logs = [], {}
    for run in case.of(role="check"):
        log = logs[run.name] = run.log
        given = {} if log.axes() else {"spindle_load_pct": log["spindle_load_pct"]}
        response = respond(machine, told_of(log, machine), recorded=given)
        for signal in measured_signals(log):
            if signal in response.columns and signal not in given:
                names, label = regime_labels(log, signal, machine)
                twin = response.columns[signal]
                unit = UNITS[signal.rsplit("_", 1)[1]]
                chance = np.hypot(noise_of(machine, log, signal), response.spread.get(signal, 0.0))
                floor = np.maximum(floors.of(log, signal), chance)  # two runs with a few stops can agree by luck
                traces.append(Trace(run.name, signal, unit, log.t_s, log[signal], twin, twin, floor, label, names, False))
    return tuple(traces), logs
