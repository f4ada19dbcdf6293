"""Coolant cools while it is on.

1/R = 1/R · (1 + gain)   while the coolant is on

The coolant carries heat off in proportion to the rise of the temperature. On recordings with this effect that leaves nothing but
the noise of the sensor, at the stated gain; coolant that takes a part of the heat at its source leaves twice as much.
"""

from twin.effects.effect import Effect, Excitation, On, Parameter
from twin.sites import Site


def cooling_w_per_k(cooling_w_per_k: float, coolant_on: float, gain: float) -> float:
    """Heat to the surroundings by kelvin."""
    return cooling_w_per_k * (1.0 + gain * coolant_on)


EFFECT = Effect(
    name="coolant_cooling",
    says="coolant cools",
    site=Site.THERMAL,
    on=On.MACHINE,
    parameters=(Parameter("gain", "", 0.0, 0.0, 20.0, 0.3, "part by which the cooling is more while the coolant is on"),),
    changes={"cooling_w_per_k": cooling_w_per_k},
    shows_in=("spindle_temp_c",),
    excited_by=Excitation.COOLANT_SWITCHED,
    equation="1/R = 1/R (1 + gain · coolant_on)",
    reference="Newton's law of cooling with a second path in parallel",
)
