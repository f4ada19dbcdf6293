"""The control feeds the velocity of the reference forward to the velocity loop, so that the axis follows more closely.

v_cmd = K_p (ref − pos) + gain · d ref/dt
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def velocity_command_mm_s(velocity_command_mm_s: float, reference_velocity_mm_s: float, gain: float) -> float:
    """Adds the part that is fed forward."""
    return velocity_command_mm_s + gain * reference_velocity_mm_s


EFFECT = Effect(
    name="velocity_feedforward",
    site=Site.CONTROLLER,
    on=On.AXIS,
    parameters=(Parameter("gain", "", 0.0, 0.0, 1.2, 0.3, "1 = the whole velocity"),),
    changes={"velocity_command_mm_s": velocity_command_mm_s},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    likely_in={"constant speed": 3, "rapid": 2},
    equation="v_cmd = K_p (ref − pos) + gain dref/dt",
    reference="FANUC AC servo parameter manual B-65270EN, advanced preview feed-forward",
)
