"""The velocity that the loop is fed is a little old: it comes from differences of encoder positions, or through a filter.

    v_feedback(t) = v(t) − delay · (v(t) − v(t − T)) / T

The difference of the last two positions over a period T is the mean of the two velocities, a delay of T / 2.
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def velocity_feedback_mm_s(
    velocity_feedback_mm_s: float, previous_mm_s: float, period_s: float, delay_s: float
) -> tuple[float, float]:
    """The older velocity, and the one to take the next difference against."""
    return velocity_feedback_mm_s - delay_s * (velocity_feedback_mm_s - previous_mm_s) / period_s, velocity_feedback_mm_s


EFFECT = Effect(
    name="velocity_feedback_delay",
    says="the loop of {on} is fed an old velocity",
    site=Site.CONTROLLER,
    on=On.AXIS,
    parameters=(Parameter("delay_s", "s", 0.0, 0.0, 0.005, 0.0005, "age of the velocity in the loop"),),
    states={"previous_mm_s": "velocity_mm_s"},
    changes={"velocity_feedback_mm_s": velocity_feedback_mm_s},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    shows_only_fast=True,
    likely_in={"acceleration": 3},
    equation="v_feedback = v − delay (v − v_previous)/T",
    reference="Brown, Schneider, Mulligan 1992, IEEE Trans. Industrial Electronics 39(1), velocity from encoder positions",
)
