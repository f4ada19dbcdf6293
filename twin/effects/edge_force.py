"""Forces of the edge: ploughing and rubbing, proportional to the length of the edge in the cut and not to the chip; wear.

F_t = (K_t h + K_te) a_p,   F_r = (K_e K_t h + K_re) a_p,   while there is a chip

An edge without a chip does not rub: no force in a dwell, nor on a tooth that runout keeps out of the cut. On recordings with this
effect the form leaves nothing but the noise of the sensor.
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def tangential(force_n_per_mm: float, chip_mm: float, tangential_n_per_mm: float) -> float:
    """The tangential force with the edge's own."""
    return force_n_per_mm + tangential_n_per_mm if chip_mm > 0.0 else force_n_per_mm


def radial(force_n_per_mm: float, chip_mm: float, radial_n_per_mm: float) -> float:
    """The radial force with the edge's own."""
    return force_n_per_mm + radial_n_per_mm if chip_mm > 0.0 else force_n_per_mm


EFFECT = Effect(
    name="edge_force",
    says="the edge rubs",
    site=Site.PROCESS_FORCE,
    on=On.MACHINE,
    parameters=(
        Parameter("tangential_n_per_mm", "N/mm", 0.0, 0.0, 300.0, 15.0, "K_te, tangential force of the edge by its length"),
        Parameter("radial_n_per_mm", "N/mm", 0.0, 0.0, 500.0, 20.0, "K_re, radial force of the edge by its length"),
    ),
    changes={"tangential_n_per_mm": tangential, "radial_n_per_mm": radial},
    shows_in=("force_x_n", "force_y_n", "spindle_load_pct", "x_torque_a", "y_torque_a"),
    equation="F_t = (K_t h + K_te) a_p, F_r = (K_e K_t h + K_re) a_p while h > 0",
    reference="Budak, Altintas, Armarego 1996, J. Eng. Ind. 118(2): the edge coefficients of the linear force model",
)
