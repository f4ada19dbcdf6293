"""The table-side position drifts as the machine grows with its temperature.

table = table + um_per_k / 1000 · (T − T_start)
"""

from twin.effects.effect import BuildsUp, Effect, On, Parameter
from twin.sites import Site


def reading(reading: float, temperature_rise_k: float, um_per_k: float) -> float:
    """Adds the growth, mm."""
    return reading + 0.001 * um_per_k * temperature_rise_k


EFFECT = Effect(
    name="thermal_growth",
    says="{on} grows as the machine warms",
    site=Site.SENSOR,
    on=On.AXIS,
    parameters=(Parameter("um_per_k", "µm/K", 0.0, -100.0, 100.0, 5.0, "growth for each kelvin of the spindle"),),
    changes={"reading": reading},
    shows_in=("{a}_table_mm",),
    needs=("temperature_rise_k",),
    builds_up=BuildsUp.MOTION,
    equation="table += um_per_k/1000 (T − T_start)",
    reference="ISO 230-3:2020, environmental and thermal distortion tests",
)
