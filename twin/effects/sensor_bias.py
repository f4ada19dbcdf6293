"""A sensor that reads a constant too much: an offset of an amplifier, a zero point.

reading = value + bias
"""

from twin.effects.effect import OF_SIGNAL, Effect, On, Parameter
from twin.sites import Site


def reading(reading: float, bias: float) -> float:
    """Adds the bias."""
    return reading + bias


def undo(reading: float, bias: float) -> float:
    """Return the value at which the sensor reads this at rest."""
    return reading - bias


EFFECT = Effect(
    name="sensor_bias",
    says="{on} is read with an offset",
    site=Site.SENSOR,
    on=On.SIGNAL,
    parameters=(Parameter("bias", OF_SIGNAL, 0.0, -1e6, 1e6, 1.0, "what it reads too much"),),
    changes={"reading": reading},
    shows_in=("{s}",),
    undo=undo,
    same_on={"spindle_temp_c": "ambient_temp_c"},
    equation="reading = value + bias",
    reference="JCGM 200:2012 (VIM) 4.20, instrumental bias",
)
