"""A contact that gives before it slides: bristles (Dahl 1968; LuGre, Canudas de Wit et al. 1995, without damping).

dz/dt = v − σ |v| z / F(v),   F_friction = σ z
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site

RIGID = float("inf")


def bristle_compliance_mm_per_n(bristle_compliance_mm_per_n: float, stiffness_n_per_mm: float) -> float:
    """The inverse of the stiffness; 0 where the contact is rigid."""
    return bristle_compliance_mm_per_n + 1.0 / stiffness_n_per_mm


EFFECT = Effect(
    name="presliding",
    site=Site.FRICTION,
    on=On.AXIS,
    parameters=(Parameter("stiffness_n_per_mm", "N/mm", RIGID, 500.0, 1e6, 2e4, "of the contact before it slides"),),
    changes={"bristle_compliance_mm_per_n": bristle_compliance_mm_per_n},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    equation="dz/dt = v − stiffness |v| z / F(v), F = stiffness z",
    reference="Canudas de Wit, Olsson, Åström, Lischinsky 1995, IEEE Trans. Automatic Control 40(3), eq. 1 to 4",
)
