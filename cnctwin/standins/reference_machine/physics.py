"""The whole physics of a reference machine: what an effect changes, as one frozen value."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import pi
from typing import Any

from cnctwin.standins.reference_machine.axis import AxisPhysics
from cnctwin.standins.reference_machine.heat import HeatPhysics
from cnctwin.standins.reference_machine.milling import CutPhysics
from cnctwin.standins.reference_machine.spindle import MeterPhysics
from cnctwin.standins.reference_machine.stated import AxisFigures, MachineFigures, NoiseFigures


@dataclass(frozen=True, slots=True)
class SensorPhysics:
    """reading = bias + scale · value, with a first-order lag, of a value that may be late; nominally the value."""

    bias: float = 0.0
    scale: float = 1.0
    lag_s: float = 0.0
    late_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Physics:
    """axes: by letter; sensors: by column, those that are not nominal; clock_*: of the feedback; coupling: axis → (other, kg)."""

    axes: Mapping[str, AxisPhysics]
    cut: CutPhysics
    meter: MeterPhysics
    heat: HeatPhysics
    noise: NoiseFigures
    sensors: Mapping[str, SensorPhysics] = field(default_factory=dict)
    clock_ppm: float = 0.0
    clock_offset_s: float = 0.0
    coupling: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    pump: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    disturbance_n: float = 1.0
    disturbance_s: float = 0.05

    def with_axis(self, letter: str, **changes: float) -> "Physics":
        """The physics with one axis changed."""
        return replace(self, axes={**self.axes, letter: self.axes[letter]._replace(**changes)})

    def with_part(self, part: str, **changes: Any) -> "Physics":
        """The physics with the cut, the meter or the heat changed."""
        old = getattr(self, part)
        new: Any = replace(old, **changes) if isinstance(old, MeterPhysics) else old._replace(**changes)
        return replace(self, **{part: new})

    def with_sensor(self, column: str, **changes: float) -> "Physics":
        """The physics with one sensor changed."""
        return replace(self, sensors={**self.sensors, column: replace(self.sensors.get(column, SensorPhysics()), **changes)})


def physics_of(machine: MachineFigures) -> Physics:
    """The physics of a machine whose figures are true."""
    tool, spindle, heat = machine.tool, machine.spindle, machine.heat
    return Physics(
        {letter: _axis(figures) for letter, figures in machine.axes.items()},
        CutPhysics(tool.diameter_mm, tool.teeth, tool.tangential_coefficient_n_per_mm2, tool.radial_ratio),
        MeterPhysics(spindle.rated_power_kw, spindle.efficiency, spindle.idle_power_kw),
        HeatPhysics(heat.alpha_w_per_pct_rpm2, heat.beta_w_per_rpm, 1.0 / heat.resistance_k_per_w, heat.capacity_j_per_k),
        machine.noise,
    )


def _axis(figures: AxisFigures) -> AxisPhysics:
    return AxisPhysics(
        figures.mass_kg,
        2000.0 * pi * figures.torque_constant_nm_per_a / figures.screw_lead_mm,
        figures.screw_lead_mm,
        figures.position_gain_per_s,
        figures.velocity_gain_a_s_per_mm,
        figures.velocity_integral_gain_a_per_mm,
        figures.torque_limit_a,
        figures.coulomb_n,
        figures.static_n,
        figures.stribeck_velocity_mm_s,
        figures.viscous_n_s_per_mm,
    )
