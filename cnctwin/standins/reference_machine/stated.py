"""The reference machine's own statement, and what it truly is: the same figures, the physical ones a few percent off.

A stated machine is drawn again for each question, so that no figure of one can be learned.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from math import pi
from typing import TypeVar

import numpy as np
import tomli_w

UNCERTAINTY = 0.03
"""One standard deviation of each physical constant, relative; the truth lies within two."""


@dataclass(frozen=True, slots=True)
class AxisFigures:
    """Feed drive and loops of an axis; units as `machine.toml` names them."""

    mass_kg: float
    screw_lead_mm: float
    torque_constant_nm_per_a: float
    position_gain_per_s: float
    velocity_gain_a_s_per_mm: float
    velocity_integral_gain_a_per_mm: float
    torque_limit_a: float
    coulomb_n: float
    static_n: float
    stribeck_velocity_mm_s: float
    viscous_n_s_per_mm: float

    @property
    def newton_per_ampere(self) -> float:
        """Force of the screw by ampere: k_t 2π / lead. 1.2 N·m/A on 12 mm make 628 N/A."""
        return 2000.0 * pi * self.torque_constant_nm_per_a / self.screw_lead_mm


@dataclass(frozen=True, slots=True)
class ToolFigures:
    """The end mill and the material."""

    diameter_mm: float
    teeth: int
    tangential_coefficient_n_per_mm2: float
    radial_ratio: float


@dataclass(frozen=True, slots=True)
class SpindleFigures:
    """The spindle drive."""

    rated_power_kw: float
    efficiency: float
    idle_power_kw: float


@dataclass(frozen=True, slots=True)
class HeatFigures:
    """The spindle's heat."""

    alpha_w_per_pct_rpm2: float
    beta_w_per_rpm: float
    resistance_k_per_w: float
    capacity_j_per_k: float


@dataclass(frozen=True, slots=True)
class NoiseFigures:
    """One standard deviation of each sensor."""

    position_mm: float = 0.0003
    table_mm: float = 0.0003
    torque_a: float = 0.010
    force_n: float = 2.0
    spindle_load_pct: float = 0.15
    spindle_temp_c: float = 0.08


@dataclass(frozen=True, slots=True)
class MachineFigures:
    """The whole machine; axes by letter. Its loops tick every millisecond."""

    axes: Mapping[str, AxisFigures]
    tool: ToolFigures
    spindle: SpindleFigures
    heat: HeatFigures
    noise: NoiseFigures


EXACT = {
    *("screw_lead_mm", "position_gain_per_s", "velocity_gain_a_s_per_mm", "velocity_integral_gain_a_per_mm", "torque_limit_a"),
    *("diameter_mm", "teeth", "rated_power_kw"),
}
"""The figures that a machine knows of itself: gains, leads, counts, what is written on a plate."""


def drawn_machine(chance: np.random.Generator) -> MachineFigures:
    """A machining centre as one is stated: three axes, an end mill, a spindle, its heat."""
    return MachineFigures(
        {letter: _drawn_axis(chance, letter) for letter in "xyz"},
        ToolFigures(
            float(chance.choice([12.0, 16.0, 20.0, 25.0])),
            int(chance.integers(3, 6)),
            round(_spread(chance, 650.0, 1900.0), 0),
            round(float(chance.uniform(0.3, 0.5)), 2),
        ),
        SpindleFigures(float(chance.choice([7.5, 11.0, 15.0])), round(float(chance.uniform(0.78, 0.9)), 2), 0.25),
        HeatFigures(
            float(f"{_spread(chance, 1.5e-8, 3.2e-8):.3g}"),
            float(f"{_spread(chance, 0.011, 0.022):.3g}"),
            float(f"{_spread(chance, 0.09, 0.16):.3g}"),
            float(f"{_spread(chance, 6500.0, 12000.0):.3g}"),
        ),
        NoiseFigures(),
    )


def _spread(chance: np.random.Generator, low: float, high: float) -> float:
    """A figure drawn evenly over its logarithm."""
    return float(np.exp(chance.uniform(np.log(low), np.log(high))))


def _drawn_axis(chance: np.random.Generator, letter: str) -> AxisFigures:
    mass_kg = round(_spread(chance, 220.0, 520.0), 0)
    lead_mm = float(chance.choice([8.0, 10.0, 12.0, 16.0]))
    torque_constant = round(float(chance.uniform(0.9, 1.7)), 2)
    newton_per_ampere = 2000.0 * pi * torque_constant / lead_mm
    bandwidth_per_s = float(chance.uniform(420.0, 620.0))
    velocity_gain = round(bandwidth_per_s * mass_kg / (1000.0 * newton_per_ampere), 3)
    coulomb_n = round(_spread(chance, 260.0, 480.0) * (0.8 if letter == "z" else 1.0), 0)
    return AxisFigures(
        mass_kg=mass_kg,
        screw_lead_mm=lead_mm,
        torque_constant_nm_per_a=torque_constant,
        position_gain_per_s=float(chance.choice([33.0, 40.0, 45.0])),
        velocity_gain_a_s_per_mm=velocity_gain,
        velocity_integral_gain_a_per_mm=round(float(chance.uniform(24.0, 34.0)) * velocity_gain, 2),
        torque_limit_a=60.0,
        coulomb_n=coulomb_n,
        static_n=round(float(chance.uniform(1.25, 1.45)) * coulomb_n, 0),
        stribeck_velocity_mm_s=round(float(chance.uniform(4.5, 8.0)), 1),
        viscous_n_s_per_mm=round(float(chance.uniform(1.8, 3.2)), 2),
    )


def scattered(machine: MachineFigures, chance: np.random.Generator) -> MachineFigures:
    """The machine as it truly is: each physical constant off by a normal deviate of 3 %, cut at two of them."""
    return MachineFigures(
        {letter: _off(axis, chance) for letter, axis in machine.axes.items()},
        _off(machine.tool, chance),
        _off(machine.spindle, chance),
        _off(machine.heat, chance),
        machine.noise,
    )


Figures = TypeVar("Figures", AxisFigures, ToolFigures, SpindleFigures, HeatFigures)


def _off(figures: Figures, chance: np.random.Generator) -> Figures:
    changed = {}
    for field in figures.__dataclass_fields__.values():
        if field.name not in EXACT:
            deviate = float(chance.standard_normal())
            while abs(deviate) > 2.0:
                deviate = float(chance.standard_normal())
            changed[field.name] = getattr(figures, field.name) * (1.0 + UNCERTAINTY * deviate)
    return replace(figures, **changed)


FRICTION = ("coulomb_n", "static_n", "stribeck_velocity_mm_s", "viscous_n_s_per_mm")


def machine_toml(machine: MachineFigures, name: str = "reference") -> str:
    """Return the machine.toml that the twin is given: formats, section 4."""
    axes = {}
    for letter, axis in machine.axes.items():
        figures = asdict(axis)
        friction = {key: figures.pop(key) for key in FRICTION}
        axes[letter] = figures | {"friction": friction}
    whole = {"machine": {"name": name, "servo_period_s": 0.001}, "axes": axes}
    parts = {"tool": asdict(machine.tool), "spindle": asdict(machine.spindle)}
    parts |= {"thermal": asdict(machine.heat), "noise": asdict(machine.noise)}
    return tomli_w.dumps(whole | parts | {"uncertainty": {"relative": UNCERTAINTY}})
