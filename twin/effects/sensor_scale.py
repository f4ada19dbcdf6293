"""A sensor whose scale is wrong: a sensitivity, a gear, a unit mixed up (25.4, 60, 1000, 9.81, π/180).

reading = scale · value
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def reading(reading: float, scale: float) -> float:
    """Scales the value."""
    return reading * scale


EFFECT = Effect(
    name="sensor_scale",
    site=Site.SENSOR,
    on=On.SIGNAL,
    parameters=(Parameter("scale", "", 1.0, -1e4, 1e4, 1.1, "reading over value"),),
    changes={"reading": reading},
    shows_in=("{s}",),
    equation="reading = scale value",
    reference="JCGM 200:2012 (VIM) 4.12, sensitivity of a measuring system",
)
