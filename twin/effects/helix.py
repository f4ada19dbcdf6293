"""The helix of the edge: it enters and leaves the cut bit by bit, tip first.

φ(z) = φ − 2 z tan β / D

at the height z above the tip. How forces along the edge are added up exactly is said in `twin.process.kernel`.
"""

from math import tan

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def lag_rad(lag_rad: float, axial_depth_mm: float, tool_diameter_mm: float, angle_deg: float) -> float:
    """The lag of the edge where it leaves the work at the top."""
    return lag_rad + 2.0 * axial_depth_mm * tan(angle_deg * 0.017453292519943295) / tool_diameter_mm


EFFECT = Effect(
    name="helix",
    says="the edge has a helix",
    site=Site.PROCESS_FORCE,
    on=On.MACHINE,
    parameters=(Parameter("angle_deg", "°", 0.0, 0.0, 60.0, 30.0, "β, angle of the edge to the axis of the tool"),),
    changes={"lag_rad": lag_rad},
    shows_in=("force_x_n", "force_y_n", "x_torque_a", "y_torque_a"),
    far_from_linear=True,
    shows_only_fast=True,
    equation="φ(z) = φ − 2 z tan β / D",
    reference="Altintas, Manufacturing Automation, 2nd ed. 2012, section 2.8",
)
