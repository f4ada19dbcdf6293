"""The rise of the spindle's temperature over a run, for what grows with it: quieter than its sensor.

Within some minutes a spindle warms by little more than its sensor's noise, and a growth that is fitted over such readings comes
out too small (errors in variables). The heat that is recorded gives the shape of the rise, and the readings its size, as far as
they say more than the machine's file does:

    T(t) = T₀ + (1 + g) ΔT(t),   g ~ N(0, s²),   reading = T + noise

s is twice the uncertainty that the file states of its constants, of which heat and capacity take part. Where a moving parabola
over a part of the run leaves less noise than CLEAR of the rise, that is taken; where load, speed or surroundings were not
recorded, one over the whole run.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from twin.case import Run
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants
from twin.machine import MachineFile
from twin.runlog import RunLog
from twin.simulator.recorded import noise_of

Floats = NDArray[np.float64]
SIGNAL = "spindle_temp_c"
HEATED_BY = ("spindle_load_pct", "spindle_rpm", "ambient_temp_c")
CLEAR = 0.02
SHAPE_DEVIATIONS = 2.0
CURVE_MIN = 3
"""Readings that a parabola takes: of so many it leaves the noise of one."""
CURVED_MIN = 10
"""Readings from which on the bend of a rise is looked at."""


@dataclass(frozen=True, slots=True, eq=False)
class Rise:
    """The rise since the start of a run at each sample, (n,), and its standard error, relative."""

    rise_k: Floats
    error: float


def temperature_rise(machine: MachineFile, group: Sequence[Run]) -> Rise | None:
    """The rise in a run, or in repeated ones together; None where it was not recorded."""
    log = group[0].log
    if not log.has(SIGNAL):
        return None
    alike = [run.log[SIGNAL] for run in group if run.log.has(SIGNAL) and len(run.log) == len(log)]
    mean, count = np.mean(alike, axis=0), len(alike)
    if not np.isfinite(mean).any():
        mean, count = log[SIGNAL], 1
    known = np.flatnonzero(np.isfinite(mean))
    readings, at_s = mean[known], log.t_s[known]
    noise = max(noise_of(machine, log, SIGNAL) / np.sqrt(count), 1e-3)
    if (clear := _smoothed(readings, noise)) is not None:
        rise, error = clear, CLEAR
    elif (shape := _shape(machine, log, known)) is not None:
        rise, error = _scaled(shape, readings, noise, SHAPE_DEVIATIONS * machine.uncertainty.get("relative", 0.05))
    else:
        rise = _parabola(readings, at_s)
        error = min(noise * np.sqrt(12.0 / len(rise)) / max(abs(float(rise[-1] - rise[0])), 1e-9), 1.0)
    if clear is None and len(rise) > 1 and log.t_s[-1] > at_s[-1]:  # as fast as before to the end
        further = (rise[-1] - rise[-2]) / (at_s[-1] - at_s[-2]) * (log.t_s[-1] - at_s[-1])
        rise, at_s = np.append(rise, rise[-1] + further), np.append(at_s, log.t_s[-1])
    return Rise(np.interp(log.t_s, at_s, rise - rise[0]), error)


def _smoothed(readings: Floats, noise: float) -> Floats | None:
    """The readings by a parabola over as few about each as leave less noise than CLEAR of the rise; None where too many would."""
    window = 1
    while window <= len(readings) // 4:
        smooth = savgol_filter(readings, window, 2) if window > CURVE_MIN else readings
        if noise / np.sqrt(max(window / CURVE_MIN, 1.0)) < CLEAR * np.ptp(smooth):
            return np.asarray(smooth)
        window = 2 * window + 1
    return None


def _shape(machine: MachineFile, log: RunLog, known: NDArray[np.intp]) -> Floats | None:
    """The rise by the heat that was recorded, as the machine states it; None where that is not known."""
    if machine.thermal is None or not log.has(*HEATED_BY):
        return None
    load, rpm, ambient = (_held(log[name], known) for name in HEATED_BY)
    coolant = _held(log["coolant_on"], known) if log.has("coolant_on") else None
    start = float(np.median(log[SIGNAL][known[:5]]))
    warming = Warming(log.t_s[known], load, rpm, ambient, coolant)
    return np.asarray(spindle_temperature_c(thermal_constants(machine.thermal), warming, start)[0] - start)


def _held(values: Floats, known: NDArray[np.intp]) -> Floats:
    """The values at these samples, between those that there are."""
    there = np.flatnonzero(np.isfinite(values))
    return np.interp(known, there, values[there])


def _scaled(shape: Floats, readings: Floats, noise: float, deviation: float) -> tuple[Floats, float]:
    """The shape at the size that fits the readings, known to a relative `deviation` before, and its relative error now.

    >>> shape = np.linspace(0.0, 1.0, 200)
    >>> scaled, error = _scaled(shape, 20.0 + 1.05 * shape, 0.01, 0.1)
    >>> bool(abs(scaled[-1] - 1.05) < 0.001), bool(error < 0.01)
    (True, True)
    """
    about = shape - shape.mean()
    certainty = float(about @ about) / noise**2 + deviation**-2
    part = float(about @ (readings - readings.mean() - about)) / noise**2 / certainty
    return np.asarray(shape * (1.0 + part)), float(certainty**-0.5)


def _parabola(readings: Floats, at_s: Floats) -> Floats:
    if len(readings) < 2:
        return np.zeros(len(readings))
    degree = 2 if len(readings) >= CURVED_MIN else 1
    since = (at_s - at_s[0]) / max(float(at_s[-1] - at_s[0]), 1e-9)
    return np.asarray(np.polyval(np.polyfit(since, readings, degree), since))
