"""A force that is periodic in the motor's angle: cogging, pole pairs, an offset of a current sensor.

F_drive = k · (torque + amplitude · sin(order · 2π · x / lead + phase))
"""

from twin.effects.effect import Effect, On, Parameter
from twin.kernels.elementary import sine_of_turns
from twin.sites import Site


def drive_force_n(
    drive_force_n: float,
    newton_per_command: float,
    midpoint_mm: float,
    screw_lead_mm: float,
    amplitude_a: float,
    order: float,
    phase_rad: float,
) -> float:
    """Adds the ripple, at the middle of the step."""
    turns = order * midpoint_mm / screw_lead_mm + phase_rad * 0.15915494309189535
    return drive_force_n + newton_per_command * amplitude_a * sine_of_turns(turns)


EFFECT = Effect(
    name="torque_ripple",
    says="{on} has a force that comes back with each turn of its motor",
    site=Site.DRIVE_FORCE,
    on=On.AXIS,
    parameters=(
        Parameter("amplitude_a", "A", 0.0, -5.0, 5.0, 0.05, "of the ripple, in units of the torque command"),
        Parameter("order", "", None, 1.0, 72.0, 6.0, "periods in a turn of the motor"),
        Parameter("phase_rad", "rad", None, -6.283185307179586, 6.283185307179586, 0.0, "at machine position 0"),
    ),
    changes={"drive_force_n": drive_force_n},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    needs=("screw_lead_mm",),
    shows_only_fast=True,
    likely_in={"constant speed": 2},
    equation="F = k (torque + amplitude sin(order 2π x/lead + phase))",
    reference="Holtz, Springob 1996, IEEE Trans. Industrial Electronics 43(2), torque ripple of PM drives",
)
