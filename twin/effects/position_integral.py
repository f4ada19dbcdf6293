"""The position loop has an integral part: it drives the following error to zero, also on an even motion.

v_cmd = K_p (e + gain ∫ e dt),   e = ref − pos
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def velocity_command_mm_s(
    velocity_command_mm_s: float,
    following_error_mm: float,
    position_gain_per_s: float,
    period_s: float,
    error_integral_mm_s: float,
    gain_per_s: float,
) -> tuple[float, float]:
    """Adds the integral part; the integral of the error goes on."""
    error_integral_mm_s = error_integral_mm_s + following_error_mm * period_s
    return velocity_command_mm_s + position_gain_per_s * gain_per_s * error_integral_mm_s, error_integral_mm_s


EFFECT = Effect(
    name="position_integral",
    says="the position loop of {on} has an integral part",
    site=Site.CONTROLLER,
    on=On.AXIS,
    parameters=(Parameter("gain_per_s", "1/s", 0.0, 0.0, 60.0, 5.0, "inverse of the reset time of the position loop"),),
    states={"error_integral_mm_s": 0.0},
    changes={"velocity_command_mm_s": velocity_command_mm_s},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    shows_only_fast=True,
    equation="v_cmd = K_p (e + gain ∫ e dt)",
    reference="Åström, Hägglund 2006, Advanced PID Control, section 3.2; Altintas 2012, Manufacturing Automation, section 5.6",
    carried=("error_integral_mm_s",),
)
