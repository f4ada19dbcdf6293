"""Elastic wind-up between motor and table: screw, nut and bearings give under the force that they pass on.

    table = motor − F_drive / stiffness

Quasi-static: the force that goes through the screw is the whole drive force, and the mode of the two masses is far above what the
loops excite.
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site

RIGID = float("inf")


def table_mm(table_mm: float, drive_force_n: float, stiffness_n_per_mm: float) -> float:
    """The table, behind the motor by the wind-up."""
    return table_mm - drive_force_n / stiffness_n_per_mm


EFFECT = Effect(
    name="screw_compliance",
    site=Site.MECHANICS,
    on=On.AXIS,
    parameters=(Parameter("stiffness_n_per_mm", "N/mm", RIGID, 2000.0, 1e7, 8e4, "axial, from motor to table"),),
    changes={"table_mm": table_mm},
    shows_in=("{a}_table_mm",),
    far_from_linear=True,
    likely_in={"reversal": 3, "acceleration": 1, "table": 2},
    equation="table = motor − F_drive / stiffness",
    reference="Altintas et al. 2011, CIRP Annals 60(2), axial stiffness of ball-screw drives",
)
