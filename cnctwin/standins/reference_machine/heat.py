"""The spindle's heat: heat balances of spindle and column, integrated by the classical Runge-Kutta method, five steps a second.

C dT/dt = alpha load rpm² + beta rpm − G(rpm, coolant) (T − T_ambient) − g (T − T₂)
C₂ dT₂/dt = g (T − T₂) − 0.1 g (T₂ − T_ambient)
"""

# ruff: noqa: PLR0917 - physics takes what its equation takes

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
STEPS = 5


class HeatPhysics(NamedTuple):
    """Constants; from `column_w_per_k` on, what a nominal spindle does not have, at nothing.

    coolant comes up within `coolant_s`; cabinet_* is a second source of heat with its own cycle; tight a bearing that rubs more
    from a rise of `tight_k` on; radiant heat by the hall, which grows over the day; radiating heat that goes off with a power of
    the rise
    """

    alpha: float
    beta: float
    cooling_w_per_k: float
    capacity: float
    column_w_per_k: float = 0.0
    column_capacity: float = 40000.0
    turning: float = 0.0
    turning_exponent: float = 0.7
    coolant: float = 0.0
    coolant_s: float = 20.0
    cabinet_w: float = 0.0
    cabinet_period_s: float = 1500.0
    cabinet_part: float = 0.4
    tight: float = 0.0
    tight_k: float = 6.0
    radiant_w_per_s: float = 0.0
    radiating: float = 0.0


@njit(cache=True)
def _rates(
    p: HeatPhysics, t: float, spindle: float, column: float, load: float, rpm: float, ambient: float, cooled: float
) -> tuple[float, float]:
    """K/s of spindle and column."""
    rubbing = p.beta * rpm
    rise = spindle - ambient
    if p.tight != 0.0 and rise > p.tight_k:
        rubbing *= 1.0 + p.tight
    heat = p.alpha * max(load, 0.0) * rpm * rpm + rubbing + p.radiant_w_per_s * t
    if p.cabinet_w != 0.0 and (t % p.cabinet_period_s) < p.cabinet_part * p.cabinet_period_s:
        heat += p.cabinet_w
    cooling = p.cooling_w_per_k * (1.0 + p.turning * (rpm / 5000.0) ** p.turning_exponent) * (1.0 + p.coolant * cooled)
    if p.radiating != 0.0:
        cooling *= (max(rise, 0.01) / 8.0) ** p.radiating
    across = p.column_w_per_k * (spindle - column)
    return (heat - cooling * rise - across) / p.capacity, (
        across - 0.1 * p.column_w_per_k * (column - ambient)
    ) / p.column_capacity


@njit(cache=True)
def temperature_c(
    p: HeatPhysics, period_s: float, start_c: float, load: Floats, rpm: Floats, ambient: Floats, coolant: Floats
) -> Floats:
    """At each sample, (n,), `period_s` apart, inputs held in between."""
    spindle, column, cooled = start_c, start_c, coolant[0]
    shown = np.empty(len(load))
    h = period_s / STEPS
    for sample in range(len(load)):
        shown[sample] = spindle
        given = (load[sample], rpm[sample], ambient[sample])
        for step in range(STEPS):
            t = (sample * STEPS + step) * h
            cooled += h / (p.coolant_s + h) * (coolant[sample] - cooled)
            a1, b1 = _rates(p, t, spindle, column, given[0], given[1], given[2], cooled)
            a2, b2 = _rates(p, t, spindle + 0.5 * h * a1, column + 0.5 * h * b1, given[0], given[1], given[2], cooled)
            a3, b3 = _rates(p, t, spindle + 0.5 * h * a2, column + 0.5 * h * b2, given[0], given[1], given[2], cooled)
            a4, b4 = _rates(p, t, spindle + h * a3, column + h * b3, given[0], given[1], given[2], cooled)
            spindle += h * (a1 + 2.0 * (a2 + a3) + a4) / 6.0
            column += h * (b1 + 2.0 * (b2 + b3) + b4) / 6.0
    return shown
