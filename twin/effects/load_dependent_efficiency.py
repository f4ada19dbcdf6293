"""A spindle drive that is less efficient at low load.

η(P) = η (1 − drop · exp(−P_cut / knee))

Bounded and smooth: at rest 1 − drop of the stated efficiency, all of it well above the knee. On recordings with this effect it
leaves nothing but the noise of the sensor, at the stated drop too; a fixed loss of power (1 − drop / (1 + P / knee)), a straight
ramp up to the knee and a square in the exponent leave more there.
"""

from math import exp

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def efficiency(efficiency: float, cutting_power_kw: float, drop: float, knee_kw: float) -> float:
    """The efficiency at this power of the cut."""
    return efficiency * (1.0 - drop * exp(-cutting_power_kw / knee_kw))


EFFECT = Effect(
    name="load_dependent_efficiency",
    says="the spindle drive is less efficient at low load",
    site=Site.SPINDLE,
    on=On.MACHINE,
    parameters=(
        Parameter("drop", "", 0.0, 0.0, 0.95, 0.3, "part of the efficiency that is missing at no load"),
        Parameter("knee_kw", "kW", None, 0.01, 50.0, 0.6, "power of the cut at which 37 % of the drop is left"),
    ),
    changes={"efficiency": efficiency},
    shows_in=("spindle_load_pct",),
    equation="η(P) = η (1 − drop exp(−P_cut / knee))",
    reference="efficiency of drives over load, as IEC 60034-30 and IEC 61800-9 tabulate it, in its simplest bounded form",
)
