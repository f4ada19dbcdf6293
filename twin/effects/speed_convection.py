"""Turning cools: the spindle's heat goes off the better, the faster it turns.

1/R(n) = 1/R · (1 + gain · (n / 5,000 rev/min)^exponent)

The gain is stated amid the range of machining spindles, so that the exponent is only the slope.
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def cooling_w_per_k(cooling_w_per_k: float, spindle_rpm: float, gain: float, exponent: float) -> float:
    """Heat to the surroundings by kelvin, at this speed of either sense."""
    speed_rpm = spindle_rpm if spindle_rpm > 0.0 else -spindle_rpm
    return cooling_w_per_k * (1.0 + gain * (speed_rpm / 5000.0) ** exponent) if speed_rpm > 0.0 else cooling_w_per_k


EFFECT = Effect(
    name="speed_convection",
    says="turning cools the spindle",
    site=Site.THERMAL,
    on=On.MACHINE,
    parameters=(
        Parameter("gain", "", 0.0, 0.0, 20.0, 0.4, "part by which the cooling is more at 5,000 rev/min than at rest"),
        Parameter("exponent", "", None, 0.2, 2.0, 0.7, "0.5 laminar, 0.8 turbulent flow over the turning part"),
    ),
    changes={"cooling_w_per_k": cooling_w_per_k},
    shows_in=("spindle_temp_c",),
    equation="1/R(n) = 1/R (1 + gain (n / 5,000 rev/min)^exponent)",
    reference="Bossmanns, Tu 1999, Int. J. Mach. Tools Manuf. 39(9): heat transfer of a turning spindle",
)
