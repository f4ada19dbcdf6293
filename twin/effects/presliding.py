"""A contact that gives before it slides: bristles (Dahl 1968; LuGre, Canudas de Wit et al. 1995).

dz/dt = v − σ |v| z / F(v),   F_friction = σ z + σ₁ v

Bristle damping is taken on the velocity itself, as implementations of LuGre often have it for its steadiness: it then is there in
steady sliding too. On a recorded axis with this effect 6 N·s/mm of it leave nothing but noise, where none leaves a half of the
torque unexplained.
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site

RIGID = float("inf")


def bristle_compliance_mm_per_n(bristle_compliance_mm_per_n: float, stiffness_n_per_mm: float) -> float:
    """The inverse of the stiffness; 0 where the contact is rigid."""
    return bristle_compliance_mm_per_n + 1.0 / stiffness_n_per_mm


def viscous_n_s_per_mm(viscous_n_s_per_mm: float, damping_n_s_per_mm: float) -> float:
    """Adds the damping of the bristles."""
    return viscous_n_s_per_mm + damping_n_s_per_mm


def bristle_mm(held_n: float, stiffness_n_per_mm: float) -> float:
    """Return how far the contact is bent at rest by the force that friction holds."""
    return held_n / stiffness_n_per_mm


EFFECT = Effect(
    name="presliding",
    says="the contact of {on} gives before it slides",
    site=Site.FRICTION,
    on=On.AXIS,
    parameters=(
        Parameter("stiffness_n_per_mm", "N/mm", RIGID, 500.0, 1e6, 2e4, "of the contact before it slides"),
        Parameter("damping_n_s_per_mm", "N·s/mm", 0.0, 0.0, 200.0, 2.0, "of the bristles"),
    ),
    changes={
        "bristle_compliance_mm_per_n": bristle_compliance_mm_per_n,
        "viscous_n_s_per_mm": viscous_n_s_per_mm,
    },
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    far_from_linear=True,
    shows_only_fast=True,
    likely_in={"rest": 2, "reversal": 1},
    at_rest={"bristle_mm": bristle_mm},
    equation="dz/dt = v − stiffness |v| z / F(v), F = stiffness z + damping v",
    reference="Canudas de Wit, Olsson, Åström, Lischinsky 1995, IEEE Trans. Automatic Control 40(3), eq. 1 to 4",
)
