"""A laboratory axis that goes through one motion lap after lap, and that somebody pushes by hand in some of them."""

import numpy as np
from numpy.typing import NDArray

from twin.machine import machine_from_toml
from twin.runlog import RunLog, run_log
from twin.servo.constants import axis_constants
from twin.servo.disturbance import Disturbance
from twin.servo.run import AxisInput, run_axes

Floats = NDArray[np.float64]
MACHINE = machine_from_toml(
    """
[machine]
name = "laboratory"
[axes.x]
mass_kg = 95.0
force_per_command_n = 35.0
position_gain_per_s = 160.0
velocity_gain_a_s_per_mm = 0.24
velocity_integral_gain_a_per_mm = 0.0
torque_limit_a = 10.0
[axes.x.friction]
coulomb_n = 20.0
static_n = 20.0
stribeck_velocity_mm_s = 5.0
viscous_n_s_per_mm = 0.20
[uncertainty]
relative = 0.05
"""
)
STROKE_MM, LAP = 60.0, 3000
PUSH = 80
"""Samples that a push lasts."""


def lap_mm() -> Floats:
    """The reference of a lap, there and back with rests between, at two speeds, (LAP,)."""
    knots = [0, 300, 1100, 1400, 2600, LAP - 1]
    place = np.interp(np.arange(LAP), knots, [0.0, 0.0, STROKE_MM, STROKE_MM, 0.0, 0.0])
    return np.convolve(np.pad(place, 40, mode="edge"), np.hanning(81) / np.hanning(81).sum(), "valid")


def pushes_n(laps: int, pushed: tuple[int, ...], seed: int, times: int) -> Floats:
    """A force on the axis of 20 to 60 N, some times in each lap that is pushed, (laps · LAP,)."""
    chance = np.random.default_rng([seed, 5])
    force = np.zeros(laps * LAP)
    for lap in pushed:
        for at in chance.choice(np.arange(2, LAP // 100 - 2), times, replace=False):
            begin = lap * LAP + 100 * int(at) + int(chance.integers(100))
            force[begin : begin + PUSH] += chance.choice([-1.0, 1.0]) * chance.uniform(20.0, 60.0)
    return force


def recorded(laps: int, pushed: tuple[int, ...] = (), seed: int = 1, times: int = 6) -> RunLog:
    """The axis over so many laps, pushed in some of them, with a disturbance of its own and the noise of its sensors."""
    force = Disturbance(0.4, 0.03).courses(1, laps * LAP, 0.001, [seed, 3]) + pushes_n(laps, pushed, seed, times)
    reference = np.tile(lap_mm(), laps)
    run = run_axes(
        {name: np.array([value]) for name, value in axis_constants(MACHINE.axes["x"]).items()},
        AxisInput(reference[None, :], np.zeros(1, dtype=np.intp), force),
    )
    noise = np.random.default_rng([seed, 4]).standard_normal((2, len(reference)))
    return run_log(
        {
            "t_s": 0.001 * np.arange(len(reference)),
            "x_ref_mm": reference,
            "x_pos_mm": run.outputs["position_mm"][0] + 3e-5 * noise[0],
            "x_torque_a": run.outputs["torque_a"][0] + 0.004 * noise[1],
        }
    )
