"""The control feeds the velocity of the reference forward to the velocity loop, so that the axis follows more closely.

v_cmd = K_p (ref − pos) + gain · (d ref/dt + ahead · d² ref/dt²)

A control knows the reference in advance, and takes its derivative over the period before, over the next one, or between them:
what is fed forward is then `ahead` of the difference to the reference before.
"""

from twin.effects.effect import Effect, Guesses, On, Parameter, Recorded
from twin.sites import Site


def velocity_command_mm_s(
    velocity_command_mm_s: float,
    reference_velocity_mm_s: float,
    reference_acceleration_mm_s2: float,
    gain: float,
    ahead_s: float,
) -> float:
    """Adds the part that is fed forward."""
    return velocity_command_mm_s + gain * (reference_velocity_mm_s + ahead_s * reference_acceleration_mm_s2)


def first_guesses(_: Recorded) -> Guesses:
    """Return gains from a little to the whole: far from the true one the axis saturates, and a slope leads nowhere."""
    return tuple({"gain": gain} for gain in (0.05, 0.2, 0.5, 0.8, 1.0))


EFFECT = Effect(
    name="velocity_feedforward",
    says="{on} is fed the velocity of its reference",
    site=Site.CONTROLLER,
    on=On.AXIS,
    parameters=(
        Parameter("gain", "", 0.0, 0.0, 1.2, 0.3, "1 = the whole velocity"),
        Parameter("ahead_s", "s", 0.0, -0.002, 0.002, 0.0005, "time by which what is fed forward is ahead"),
    ),
    changes={"velocity_command_mm_s": velocity_command_mm_s},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    first_guesses=first_guesses,
    likely_in={"constant speed": 3, "rapid": 2},
    equation="v_cmd = K_p (ref − pos) + gain (dref/dt + ahead d²ref/dt²)",
    reference="FANUC AC servo parameter manual B-65270EN, advanced preview feed-forward",
)
