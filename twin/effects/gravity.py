"""A constant force along the axis that the drive has to hold, at rest as well: an uncompensated head, a counterbalance set wrong.

M dv/dt = F_drive − F_friction − F_gravity
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def external_force_n(external_force_n: float, force_n: float) -> float:
    """Adds the load; positive pulls towards −, so that the drive holds it with a positive torque."""
    return external_force_n - force_n


def load_n(force_n: float) -> float:
    """Return what the drive holds at rest."""
    return force_n


EFFECT = Effect(
    name="gravity",
    says="a constant force pulls on {on}",
    site=Site.MECHANICS,
    on=On.AXIS,
    parameters=(Parameter("force_n", "N", 0.0, -8000.0, 8000.0, 400.0, "load that the drive has to hold, positive towards −"),),
    changes={"external_force_n": external_force_n},
    shows_in=("{a}_torque_a", "{a}_pos_mm"),
    likely_in={"rest": 1},
    usual_on=("z",),
    at_rest={"load_n": load_n},
    equation="F_external = −force_n",
    reference="Mitsubishi MELDAS MDS-C1 manual, unbalance torque of vertical axes",
)
