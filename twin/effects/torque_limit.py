"""The torque saturates below the limit that the machine states: a parameter, a hot drive, a weak supply."""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site

NONE = float("inf")


def torque_limit_a(torque_limit_a: float, limit_a: float) -> float:
    """The smaller of the two."""
    return limit_a if limit_a < torque_limit_a else torque_limit_a


EFFECT = Effect(
    name="torque_limit",
    site=Site.CONTROLLER,
    on=On.AXIS,
    parameters=(Parameter("limit_a", "A", NONE, 0.01, 1000.0, 1.5, "of torque command and integral"),),
    changes={"torque_limit_a": torque_limit_a},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    equation="|torque| ≤ limit",
    reference="FANUC AC servo parameter manual B-65270EN, torque command limit",
)
