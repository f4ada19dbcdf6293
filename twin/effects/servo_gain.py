"""Loop gains that are not the stated ones: the scale factors S_pp, S_vp and S_vi of the controller.

v_cmd = S_pp K_p (ref − pos),   torque = S_vp K_v e + ∫ S_vi K_i e
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def position_gain_per_s(position_gain_per_s: float, position_scale: float) -> float:
    """S_pp K_p."""
    return position_gain_per_s * position_scale


def velocity_gain_a_s_per_mm(velocity_gain_a_s_per_mm: float, velocity_scale: float) -> float:
    """S_vp K_v."""
    return velocity_gain_a_s_per_mm * velocity_scale


def velocity_integral_gain_a_per_mm(velocity_integral_gain_a_per_mm: float, integral_scale: float) -> float:
    """S_vi K_i."""
    return velocity_integral_gain_a_per_mm * integral_scale


EFFECT = Effect(
    name="servo_gain",
    says="the loops of {on} have other gains",
    site=Site.CONTROLLER,
    on=On.AXIS,
    parameters=(
        Parameter("position_scale", "", 1.0, 0.2, 5.0, 1.1, "S_pp"),
        Parameter("velocity_scale", "", 1.0, 0.2, 5.0, 1.1, "S_vp"),
        Parameter("integral_scale", "", 1.0, 0.0, 5.0, 1.1, "S_vi"),
    ),
    changes={
        "position_gain_per_s": position_gain_per_s,
        "velocity_gain_a_s_per_mm": velocity_gain_a_s_per_mm,
        "velocity_integral_gain_a_per_mm": velocity_integral_gain_a_per_mm,
    },
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    equation="K_p, K_v, K_i scaled by S_pp, S_vp, S_vi",
    reference="the scale factors of the MCU model that this project started from (P position, PI velocity)",
)
