"""A load meter whose 100 % is another power than stated: S1 or S6 rating, another winding, another motor.

P_rated = scale · P_rated,nominal
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def rated_power_kw(rated_power_kw: float, scale: float) -> float:
    """The power that the meter calls 100 %."""
    return rated_power_kw * scale


EFFECT = Effect(
    name="rated_power",
    says="the meter's 100 % is another power",
    site=Site.SPINDLE,
    on=On.MACHINE,
    parameters=(Parameter("scale", "", 1.0, 0.1, 10.0, 1.3, "the meter's 100 % over the stated rated power"),),
    changes={"rated_power_kw": rated_power_kw},
    shows_in=("spindle_load_pct",),
    equation="P_rated = scale · P_rated,nominal",
    reference="IEC 60034-1, duty types: continuous and intermittent rating of one motor differ",
)
