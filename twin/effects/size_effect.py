"""The size effect (Kienzle): the thinner the chip, the more force by its area.

K_t(h) = K_t (h / h₀)^(−exponent),   h₀ = 0.05 mm

Kienzle states his coefficient for a chip of 1 mm, which no milling cutter takes; a change of the exponent would then change all
forces, and exponent and coefficient could hardly be told apart. h₀ is amid the chips of finishing and roughing (0.02 to 0.15 mm
a tooth, 2/π of that on the average of a slot), so that K_t stays what it was and the exponent is only the slope.
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def tangential_coefficient_n_per_mm2(coefficient_n_per_mm2: float, chip_mm: float, exponent: float) -> float:
    """The coefficient at this chip; where there is no chip it has no say."""
    return coefficient_n_per_mm2 * (chip_mm / 0.05) ** -exponent if chip_mm > 0.0 else coefficient_n_per_mm2


EFFECT = Effect(
    name="size_effect",
    says="thin chips take more force",
    site=Site.PROCESS_FORCE,
    on=On.MACHINE,
    parameters=(Parameter("exponent", "", 0.0, 0.0, 0.8, 0.25, "m_c, rise of the coefficient as the chip thins"),),
    changes={"tangential_coefficient_n_per_mm2": tangential_coefficient_n_per_mm2},
    shows_in=("force_x_n", "force_y_n", "spindle_load_pct", "x_torque_a", "y_torque_a"),
    equation="K_t(h) = K_t (h / 0.05 mm)^(−exponent)",
    reference="Kienzle 1952, VDI-Z 94: k_c = k_c1.1 h^(−m_c), here stated at 0.05 mm",
)
