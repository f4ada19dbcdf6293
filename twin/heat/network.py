"""The spindle's heat between two samples (formats, section 4).

    C dT/dt = alpha · load · rpm² + beta · rpm − (T − T_ambient) / R

Everything on the right but T is held over a step, so the step is exact: T goes to T_final = T_ambient + P R with the time
constant R C.
"""

from math import exp
from typing import NamedTuple

from twin.kernels.assembly import Assembly
from twin.machine import Thermal
from twin.sites import Site, at


class Heat(NamedTuple):
    """The heat that goes in, W, and that goes off by kelvin of rise, W/K."""

    heat_w: float
    cooling_w_per_k: float


def heat(
    spindle_load_pct: float,
    spindle_rpm: float,
    alpha_w_per_pct_rpm2: float,
    beta_w_per_rpm: float,
    resistance_k_per_w: float,
) -> Heat:
    """Heat knows no sense of rotation, and braking does not cool.

    100 W of friction at 6,250 rev/min (0.016 W per rev/min), and 1e-8 · 50 · 6250² = 19.53 W by load:

    >>> round(heat(50.0, 6250.0, 1e-8, 0.016, 0.12).heat_w, 2)
    119.53
    """
    speed_rpm = spindle_rpm if spindle_rpm > 0.0 else -spindle_rpm
    load_pct = spindle_load_pct if spindle_load_pct > 0.0 else 0.0
    heat_w = at(Site.THERMAL, alpha_w_per_pct_rpm2 * load_pct * speed_rpm * speed_rpm + beta_w_per_rpm * speed_rpm)
    cooling_w_per_k = at(Site.THERMAL, 1.0 / resistance_k_per_w)
    return Heat(heat_w, cooling_w_per_k)


class Temperature(NamedTuple):
    """The temperature where it would settle, and after the step."""

    final_c: float
    temperature_next_c: float


def step(
    temperature_c: float,
    ambient_c: float,
    duration_s: float,
    heat_w: float,
    cooling_w_per_k: float,
    heat_capacity_j_per_k: float,
) -> Temperature:
    """An exact step. After one time constant at 100 W and 5 W/K, 63.2 % of 20 K are there:

    >>> round(step(20.0, 20.0, 1000.0, 100.0, 5.0, 5000.0).temperature_next_c, 3)
    32.642
    """
    final_c = ambient_c + heat_w / cooling_w_per_k
    decay = exp(-duration_s * cooling_w_per_k / heat_capacity_j_per_k)
    temperature_next_c = at(Site.THERMAL, final_c + (temperature_c - final_c) * decay)
    return Temperature(final_c, temperature_next_c)


HEAT = Assembly((heat, step), acts_on="the spindle's heat", owner="the spindle's heat")
INPUTS = ("spindle_load_pct", "spindle_rpm", "ambient_c", "coolant_on")
FED = (*INPUTS, "temperature_c", "duration_s", "time_s")


def thermal_quantities() -> dict[str, str]:
    """The quantities of the spindle's heat that an effect can change, with their sites."""
    return HEAT.quantities()


def thermal_constants(thermal: Thermal) -> dict[str, float]:
    """Name → value, for the physics of `twin.heat`.

    >>> thermal = Thermal(alpha_w_per_pct_rpm2=0.0, beta_w_per_rpm=0.02, resistance_k_per_w=0.2, capacity_j_per_k=5000.0)
    >>> thermal_constants(thermal)["heat_capacity_j_per_k"]
    5000.0
    """
    return {
        "alpha_w_per_pct_rpm2": thermal.alpha_w_per_pct_rpm2,
        "beta_w_per_rpm": thermal.beta_w_per_rpm,
        "resistance_k_per_w": thermal.resistance_k_per_w,
        "heat_capacity_j_per_k": thermal.capacity_j_per_k,
    }
