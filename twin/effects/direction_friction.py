"""Friction that differs by direction: a wiper, a preload, a chain on one side.

F_friction = (1 + asymmetry · sgn v) · F_nominal(v)
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def by_direction(force_n: float, direction: float, asymmetry: float) -> float:
    """The friction force in the direction of motion, or of the push from rest."""
    return force_n * (1.0 + asymmetry * direction)


EFFECT = Effect(
    name="direction_friction",
    says="friction of {on} differs by direction",
    site=Site.FRICTION,
    on=On.AXIS,
    parameters=(Parameter("asymmetry", "", 0.0, -0.6, 0.6, 0.1, "part by which friction is larger in + and smaller in −"),),
    changes={"friction_n": by_direction, "breakaway_n": by_direction},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    likely_in={"rest": 3, "constant speed": 1},
    equation="F = (1 + asymmetry sgn v) F(v)",
    reference="Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), section 2",
)
