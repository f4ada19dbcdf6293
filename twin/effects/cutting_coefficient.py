"""A material that is harder or softer than stated: K_t is another one, all forces scale.

K_t = scale · K_t,nominal
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def tangential_coefficient_n_per_mm2(tangential_coefficient_n_per_mm2: float, scale: float) -> float:
    """The coefficient of this material."""
    return tangential_coefficient_n_per_mm2 * scale


EFFECT = Effect(
    name="cutting_coefficient",
    says="the material cuts with another force",
    site=Site.PROCESS_FORCE,
    on=On.MACHINE,
    parameters=(Parameter("scale", "", 1.0, 0.2, 5.0, 1.2, "K_t over the stated one"),),
    changes={"tangential_coefficient_n_per_mm2": tangential_coefficient_n_per_mm2},
    shows_in=("force_x_n", "force_y_n", "spindle_load_pct", "x_torque_a", "y_torque_a"),
    multiplies={"tangential_coefficient_n_per_mm2": "scale"},
    equation="K_t = scale · K_t,nominal",
    reference="Altintas, Manufacturing Automation, 2nd ed. 2012, section 2.5: coefficients are a material's own",
)
