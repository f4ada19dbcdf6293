"""More mass is moved than the machine states: workpiece, fixture, pallet."""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def moving_mass_kg(moving_mass_kg: float, mass_kg: float) -> float:
    """Adds the load."""
    return moving_mass_kg + mass_kg


EFFECT = Effect(
    name="payload",
    says="{on} moves more mass",
    site=Site.MECHANICS,
    on=On.AXIS,
    parameters=(Parameter("mass_kg", "kg", 0.0, 0.0, 20000.0, 80.0, "beyond that of the machine"),),
    changes={"moving_mass_kg": moving_mass_kg},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    shows_only_fast=True,
    likely_in={"acceleration": 4},
    equation="(M + mass) dv/dt = ΣF",
    reference="FANUC AC servo parameter manual B-65270EN, load inertia ratio",
)
