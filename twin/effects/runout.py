"""Runout: the tool turns about another axis than its own, so that its teeth run on unequal radii.

r_j = R + ρ cos(phase + 2π j / teeth),   h_j = max(0, c sin φ_j + r_j − r_{j−1})

A tooth takes what its own radius has over that of the tooth before; a tooth that is too short takes nothing. On recordings with
this effect the form, with this sign of the phase, leaves nothing but the noise of the sensor; without the clip at 0 it leaves a
half more. That a tooth takes twice as much after one that took nothing is left out.

The teeth are counted in the sense of the phase. Counted the other way (r_j − r_{j+1}), the same chips have the phase
π − 2π/teeth later.
"""

from math import cos

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def tooth_radius_mm(radius_mm: float, tooth_rad: float, eccentricity_mm: float, phase_rad: float) -> float:
    """The tooth's radius over the tool's."""
    return radius_mm + eccentricity_mm * cos(phase_rad + tooth_rad)


def chip_mm(chip_mm: float, radius_step_mm: float) -> float:
    """The chip with what the radii add; equal radii leave it as it was."""
    stepped_mm = chip_mm + radius_step_mm
    return chip_mm if radius_step_mm == 0.0 else (stepped_mm if stepped_mm > 0.0 else 0.0)


EFFECT = Effect(
    name="runout",
    says="the tool runs out",
    site=Site.PROCESS_FORCE,
    on=On.MACHINE,
    parameters=(
        Parameter("eccentricity_mm", "mm", 0.0, 0.0, 0.2, 0.01, "ρ, from the tool's axis to the one it turns about"),
        Parameter("phase_rad", "rad", None, -3.2, 6.3, 1.0, "where the eccentricity points, from tooth 0"),
    ),
    changes={"tooth_radius_mm": tooth_radius_mm, "chip_mm": chip_mm},
    shows_in=("force_x_n", "force_y_n", "x_torque_a", "y_torque_a"),
    shows_only_fast=True,
    equation="h_j = max(0, c sin φ_j + r_j − r_{j−1}), r_j = R + ρ cos(phase + 2π j / teeth)",
    reference="Kline, DeVor 1983, Int. J. Mach. Tool Des. Res. 23(2-3): the effect of runout on cutting geometry and forces",
)
