"""The control adds a torque with the direction of the commanded motion, so that friction need not first show as an error.

    torque = K_v e + ∫ K_i e + torque · min(max(d ref/dt / v_full, −1), 1)

It is nothing while the reference stands. A control that switches by the sign has a v_full near 0; many ramp the torque up, so
that it does not chatter.
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def torque_command_a(
    torque_command_a: float, reference_velocity_mm_s: float, torque_a: float, full_velocity_mm_s: float
) -> float:
    """Adds the torque that is to overcome friction."""
    part = reference_velocity_mm_s / full_velocity_mm_s
    return torque_command_a + torque_a * (1.0 if part > 1.0 else -1.0 if part < -1.0 else part)


EFFECT = Effect(
    name="friction_compensation",
    says="the control of {on} compensates friction",
    site=Site.CONTROLLER,
    on=On.AXIS,
    parameters=(
        Parameter("torque_a", "A", 0.0, -50.0, 50.0, 0.5, "added in the direction of the commanded motion"),
        Parameter("full_velocity_mm_s", "mm/s", None, 0.001, 20.0, 0.1, "commanded velocity from which on all of it is added"),
    ),
    changes={"torque_command_a": torque_command_a},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    shows_only_fast=True,
    likely_in={"reversal": 2},
    equation="torque = K_v e + ∫ K_i e + torque min(max(dref/dt / v_full, −1), 1)",
    reference="Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), section 4.3: friction compensation",
)
