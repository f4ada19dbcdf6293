"""The control feeds the acceleration of the reference forward to the torque.

torque = K_v e + integral + gain · (M / k) · d²ref/dt²
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def torque_command_a(
    torque_command_a: float, reference_acceleration_mm_s2: float, mass_kg: float, newton_per_command: float, gain: float
) -> float:
    """Adds the torque that would accelerate the stated mass."""
    return torque_command_a + gain * mass_kg * 0.001 * reference_acceleration_mm_s2 / newton_per_command


EFFECT = Effect(
    name="acceleration_feedforward",
    says="{on} is fed the acceleration of its reference",
    site=Site.CONTROLLER,
    on=On.AXIS,
    parameters=(Parameter("gain", "", 0.0, 0.0, 1.5, 0.3, "1 = the torque that accelerates the stated mass"),),
    changes={"torque_command_a": torque_command_a},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    shows_only_fast=True,
    likely_in={"acceleration": 2},
    equation="torque += gain M/k d²ref/dt²",
    reference="FANUC AC servo parameter manual B-65270EN, velocity-loop feed-forward",
)
