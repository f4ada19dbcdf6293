"""The control adds a torque with the direction of the commanded motion, so that friction need not first show as an error.

    torque = K_v e + ∫ K_i e + torque · sgn(d ref/dt)

It is nothing while the reference stands.
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def torque_command_a(torque_command_a: float, reference_velocity_mm_s: float, torque_a: float) -> float:
    """Adds the torque that is to overcome friction."""
    forward = 1.0 if reference_velocity_mm_s > 0.0 else 0.0
    back = 1.0 if reference_velocity_mm_s < 0.0 else 0.0
    return torque_command_a + torque_a * (forward - back)


EFFECT = Effect(
    name="friction_compensation",
    site=Site.CONTROLLER,
    on=On.AXIS,
    parameters=(Parameter("torque_a", "A", 0.0, -50.0, 50.0, 0.5, "added in the direction of the commanded motion"),),
    changes={"torque_command_a": torque_command_a},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    shows_only_fast=True,
    likely_in={"reversal": 2},
    equation="torque = K_v e + ∫ K_i e + torque sgn(dref/dt)",
    reference="Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), section 4.3: friction compensation",
)
