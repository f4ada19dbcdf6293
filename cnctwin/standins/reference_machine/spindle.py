"""The spindle's load meter: electrical power over rated power, from the mean power of the cut over a tenth of a second.

Efficiency at part load follows the curve of a drive, idle power that of bearings (a torque that is constant and one that grows
with speed), and a meter that holds its peaks takes a moment to follow up to them.
"""

from dataclasses import dataclass
from math import exp

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
WINDOW = 100
"""Ticks over which the power is averaged."""


@dataclass(frozen=True, slots=True)
class MeterPhysics:
    """Spindle drive and meter; from `drop` on, what a nominal one does not have, at nothing.

    bent: exponent by which the reading departs from proportion (read at 20 %), dead_pct: the change that the meter does not show,
    beat_*: a slow beat of the mains on the reading, worn_kw_per_s: idle power that grows as the run goes on
    """

    rated_kw: float
    efficiency: float
    idle_kw: float
    drop: float = 0.0
    knee_kw: float = 0.6
    turning_kw: float = 0.0
    hold_s: float = 0.0
    bent: float = 0.0
    dead_pct: float = 0.0
    beat_pct: float = 0.0
    beat_hz: float = 1.7
    worn_kw_per_s: float = 0.0


def load_pct(p: MeterPhysics, power_w: Floats, rpm: Floats) -> Floats:
    """The reading at each tick, (n,), of the power of the cut, (n,), W."""
    summed = np.concatenate([[0.0], np.cumsum(power_w)])
    last = np.arange(1, len(power_w) + 1)
    first = np.maximum(last - WINDOW, 0)
    cut_kw = 0.001 * (summed[last] - summed[first]) / (last - first)
    part = np.maximum(cut_kw, 0.0) / p.knee_kw
    efficiency = p.efficiency * (1.0 - p.drop / (1.0 + part + 0.5 * part**2))
    speed = np.abs(rpm) / 5000.0
    idle_kw = p.idle_kw + p.turning_kw * (0.25 * speed + 0.75 * speed**2) + p.worn_kw_per_s * 0.001 * np.arange(len(rpm))
    load = 100.0 * (cut_kw / efficiency + idle_kw) / p.rated_kw
    if p.hold_s > 0.0:
        load = _held(load, p.hold_s)
    if p.bent != 0.0:
        load = 20.0 * (np.maximum(load, 0.0) / 20.0) ** (1.0 + p.bent)
    if p.beat_pct != 0.0:
        load = load + p.beat_pct * np.sin(2.0 * np.pi * p.beat_hz * 0.001 * np.arange(len(load)))
    return _stuck(load, p.dead_pct) if p.dead_pct > 0.0 else load


@njit(cache=True)
def _held(load: Floats, hold_s: float) -> Floats:
    """A meter that follows a rise within 5 ms, and falls by 63 % in `hold_s`."""
    shown = np.empty(len(load))
    held = load[0]
    for tick in range(len(load)):
        fallen = held * exp(-0.001 / hold_s)
        held = fallen + 0.2 * (load[tick] - fallen) if load[tick] > fallen else fallen
        shown[tick] = held
    return shown


@njit(cache=True)
def _stuck(load: Floats, dead_pct: float) -> Floats:
    """A meter that moves only when what it should show is further off than its dead band."""
    shown = np.empty(len(load))
    held = load[0]
    for tick in range(len(load)):
        if abs(load[tick] - held) > dead_pct:
            held = load[tick]
        shown[tick] = held
    return shown
