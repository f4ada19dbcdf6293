"""An error of the screw that comes back with each turn: wobble, a bent or badly seated screw.

table = motor + amplitude · sin(2π · motor / lead + phase)
"""

from twin.effects.effect import Effect, On, Parameter
from twin.kernels.elementary import sine_of_turns
from twin.sites import Site


def table_mm(table_mm: float, screw_lead_mm: float, amplitude_mm: float, phase_rad: float) -> float:
    """The table where the screw puts it."""
    return table_mm + amplitude_mm * sine_of_turns(table_mm / screw_lead_mm + phase_rad * 0.15915494309189535)


EFFECT = Effect(
    name="lead_error",
    says="the screw of {on} has an error that comes back with each turn",
    site=Site.MECHANICS,
    on=On.AXIS,
    parameters=(
        Parameter("amplitude_mm", "mm", 0.0, -0.1, 0.1, 0.005, "of the error"),
        Parameter("phase_rad", "rad", None, -6.283185307179586, 6.283185307179586, 0.0, "of the error at machine position 0"),
    ),
    changes={"table_mm": table_mm},
    shows_in=("{a}_table_mm",),
    needs=("screw_lead_mm",),
    shows_only_fast=True,
    likely_in={"table": 3},
    equation="table = motor + amplitude sin(2π motor/lead + phase)",
    reference="ISO 3408-3:2006, travel variation within one revolution",
)
