"""The torque saturates below the limit that the machine states: a parameter, a hot drive, a weak supply."""

from twin.effects.effect import Effect, Guesses, On, Parameter, Recorded
from twin.sites import Site

NONE = float("inf")


def torque_limit_a(torque_limit_a: float, limit_a: float) -> float:
    """The smaller of the two."""
    return limit_a if limit_a < torque_limit_a else torque_limit_a


def first_guesses(recorded: Recorded) -> Guesses:
    """Start from the largest torque there was: a limit shows as that."""
    largest_a = recorded.peak_of("torque_a")
    return tuple({"limit_a": part * largest_a} for part in (1.0, 0.97, 0.9)) if largest_a > 0.0 else ()


EFFECT = Effect(
    name="torque_limit",
    says="the torque of {on} is capped below its limit",
    site=Site.CONTROLLER,
    on=On.AXIS,
    parameters=(Parameter("limit_a", "A", NONE, 0.01, 1000.0, 1.5, "of torque command and integral"),),
    changes={"torque_limit_a": torque_limit_a},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    far_from_linear=True,
    shows_only_fast=True,
    likely_in={"rapid": 1},
    lowers={"torque_limit_a": "limit_a"},
    first_guesses=first_guesses,
    equation="|torque| ≤ limit",
    reference="FANUC AC servo parameter manual B-65270EN, torque command limit",
)
