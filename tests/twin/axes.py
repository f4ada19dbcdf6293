"""A small three-axis machine and a reference to run it over, for the tests of the simulated axes."""

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import effect_named
from twin.machine import MachineFile, machine_from_toml
from twin.servo.constants import axis_constants, effect_constants

Floats = NDArray[np.float64]

AXIS = """
[axes.{letter}]
mass_kg = {mass}
screw_lead_mm = {lead}
torque_constant_nm_per_a = 1.2
position_gain_per_s = 40.0
velocity_gain_a_s_per_mm = {gain}
velocity_integral_gain_a_per_mm = 9.0
torque_limit_a = 60.0
[axes.{letter}.friction]
coulomb_n = 380.0
static_n = 520.0
stribeck_velocity_mm_s = 6.0
viscous_n_s_per_mm = 2.4
"""

MACHINE = machine_from_toml(
    "[machine]\nname = 'small'\n"
    + AXIS.format(letter="x", mass=320.0, lead=12.0, gain=0.30)
    + AXIS.format(letter="y", mass=410.0, lead=12.0, gain=0.38)
    + AXIS.format(letter="z", mass=260.0, lead=10.0, gain=0.20)
)


def constants(machine: MachineFile = MACHINE, lanes: int = 1) -> dict[str, Floats]:
    """Of the machine's axes, one after another, each `lanes` times."""
    of_axes = [axis_constants(axis) for axis in machine.axes.values()]
    return {name: np.repeat([values[name] for values in of_axes], lanes) for name in of_axes[0]}


def with_effect(given: dict[str, Floats], name: str, values: dict[str, float]) -> dict[str, Floats]:
    """The same, with the parameters of an effect."""
    count = len(given["mass_kg"])
    own = effect_constants(effect_named(name), values, {}, "x")
    return given | {key: np.full(count, value) for key, value in own.items()}


def reference(ticks: int = 3000) -> Floats:
    """(3, ticks) mm: rest, strokes both ways at several speeds with bounded acceleration, reversals of 20 µm, rest."""
    t = np.arange(ticks) * 0.001
    envelope = np.clip((t - 0.1) / 0.1, 0.0, 1.0) * np.clip((t[-1] - 0.2 - t) / 0.1, 0.0, 1.0)
    x = 12.0 * np.sin(2 * np.pi * 0.9 * t) * envelope
    y = 3.0 * np.sin(2 * np.pi * 0.5 * t + 1.0) * envelope**2
    z = (0.02 * np.sin(2 * np.pi * 2.0 * t) + 1.5 * np.clip(t - 1.5, 0.0, 0.6)) * envelope
    return np.array([x, y, z])
