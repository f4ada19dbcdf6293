"""A sensor whose scale is wrong: a sensitivity, a gear, a unit mixed up (25.4, 60, 1000, 9.81, π/180).

reading = scale · value
"""

from twin.effects.effect import Effect, Guesses, On, Parameter, Recorded
from twin.sites import Site

UNIT, UNIT_MAX = 1.5, 5e3
"""Factors from which, and to which, a sensor may be in another unit."""


def reading(reading: float, scale: float) -> float:
    """Scales the value."""
    return reading * scale


def undo(reading: float, scale: float) -> float:
    """Return the value at which the sensor reads this at rest; a scale of nothing counts as 1."""
    nothing = abs(scale) <= 1e-9
    return reading / (scale * (1.0 - nothing) + nothing)


def first_guesses(recorded: Recorded) -> Guesses:
    """Start from recorded over modelled where that looks like another unit."""
    scale = recorded.over_modelled()
    return ({"scale": scale},) if abs(scale) < UNIT_MAX and not 1.0 / UNIT < scale < UNIT else ()


EFFECT = Effect(
    name="sensor_scale",
    says="{on} is read on another scale",
    site=Site.SENSOR,
    on=On.SIGNAL,
    parameters=(Parameter("scale", "", 1.0, -1e4, 1e4, 1.1, "reading over value"),),
    changes={"reading": reading},
    shows_in=("{s}",),
    undo=undo,
    same_on={"spindle_temp_c": "ambient_temp_c"},
    first_guesses=first_guesses,
    equation="reading = scale value",
    reference="JCGM 200:2012 (VIM) 4.12, sensitivity of a measuring system",
)
