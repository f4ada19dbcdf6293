"""The load meter at a tick (formats, section 4).

    spindle_load_pct = 100 (P_cut / efficiency + P_idle) / P_rated

P_cut is the power of the cut over the last 0.1 s. The power that speeds the spindle up is not in it.
"""

from typing import NamedTuple

from twin.kernels.assembly import Assembly
from twin.machine import SpindleDrive
from twin.sites import Site, at


class Reading(NamedTuple):
    """Electrical power, and what the meter makes of it."""

    electrical_power_kw: float
    spindle_load_pct: float


def reading(cutting_power_kw: float, efficiency: float, idle_power_kw: float, rated_power_kw: float) -> Reading:
    """The meter at this power of the cut.

    1.7 kW of cut at an efficiency of 0.85 and 0.25 kW of idle power are 2.25 kW, of 11 kW:

    >>> round(reading(1.7, 0.85, 0.25, 11.0).spindle_load_pct, 4)
    20.4545
    """
    efficiency = at(Site.SPINDLE, efficiency)
    idle_power_kw = at(Site.SPINDLE, idle_power_kw)
    rated_power_kw = at(Site.SPINDLE, rated_power_kw)
    electrical_power_kw = at(Site.SPINDLE, cutting_power_kw / efficiency + idle_power_kw)
    spindle_load_pct = at(Site.SPINDLE, 100.0 * electrical_power_kw / rated_power_kw)
    return Reading(electrical_power_kw, spindle_load_pct)


SPINDLE = Assembly((reading,), acts_on="the spindle", owner="the spindle")
FED = ("cutting_power_kw", "spindle_rpm", "period_s")


def spindle_quantities() -> dict[str, str]:
    """The quantities of the spindle that an effect can change, with their sites."""
    return SPINDLE.quantities()


def spindle_constants(spindle: SpindleDrive) -> dict[str, float]:
    """Name → value, for the physics of `twin.spindle`.

    >>> spindle_constants(SpindleDrive(rated_power_kw=11.0, efficiency=0.85, idle_power_kw=0.25))
    {'rated_power_kw': 11.0, 'efficiency': 0.85, 'idle_power_kw': 0.25}
    """
    return {
        "rated_power_kw": spindle.rated_power_kw,
        "efficiency": spindle.efficiency,
        "idle_power_kw": spindle.idle_power_kw,
    }
