"""The regime of each sample of a recording, as a signal of it feels it: one label each, known before any twin runs.

* of an axis: the regimes of its reference (`twin.regimes`); `rapid` where it keeps at least nine tenths of the rapid traverse
* forces, load, speed: `cutting`, `spindle ramp` while the spindle's speed changes, `dwell` while nothing moves, else `air`
* temperature: `warm-up` while the spindle turns, `cool-down` while it stands
* any but temperature: `tool change` while one is in progress
* a signal of which the run does not say what it was told: `run`
"""

import numpy as np
from numpy.typing import NDArray

from twin.machine import MachineFile
from twin.regimes import Regime, axis_regimes
from twin.runlog import AXIS_COLUMN, RunLog

Floats = NDArray[np.float64]
Labels = tuple[tuple[str, ...], NDArray[np.int8]]

RAPID_PART = 0.9
RAMP_PART = 0.002
"""A spindle whose speed changes by this part of its highest within a tenth of a second is on a ramp."""
RAMP_S = 0.1
MOTION_MM_S = 0.01
PROCESS = ("cutting", "air", "spindle ramp", "dwell", "tool change")
HEAT = ("warm-up", "cool-down")
AXIS = (*(regime.title for regime in Regime), "rapid", "tool change")


def regime_labels(log: RunLog, signal: str, machine: MachineFile) -> Labels:
    """Names of the regimes of a signal, and which of them each sample is in, (n,).

    Names without a sample are there too, so that the same signal has the same names in every run.
    """
    if signal.endswith("_temp_c"):
        turning = np.ones(len(log), dtype=bool) if not log.has("spindle_rpm") else np.nan_to_num(log["spindle_rpm"]) > 0.0
        return HEAT, np.where(turning, 0, 1).astype(np.int8)
    match = AXIS_COLUMN.match(signal)
    changing = np.nan_to_num(log.columns.get("tool_change_active", np.zeros(len(log)))) > 0.0
    if match and log.has(f"{match[1]}_ref_mm"):
        reference = _filled(log[f"{match[1]}_ref_mm"])
        label = axis_regimes(log.t_s, reference)
        label[_rapid(log.t_s, reference, label, machine)] = len(Regime)
        label[changing] = len(Regime) + 1
        return AXIS, label
    if match:
        return ("run",), np.zeros(len(log), dtype=np.int8)
    label = np.full(len(log), PROCESS.index("air"), dtype=np.int8)
    label[_still(log)] = PROCESS.index("dwell")
    label[_ramp(log)] = PROCESS.index("spindle ramp")
    label[np.nan_to_num(log.columns.get("axial_depth_mm", np.zeros(len(log)))) > 0.0] = PROCESS.index("cutting")
    label[changing] = PROCESS.index("tool change")
    return PROCESS, label


def measured_signals(log: RunLog) -> tuple[str, ...]:
    """Return the columns that a machine answers with, where the run has samples of them."""
    names = [c for c in log.columns if (m := AXIS_COLUMN.match(c)) and m[2] != "ref_mm"]
    names += ["force_x_n", "force_y_n", "spindle_load_pct", "spindle_temp_c"]
    return tuple(name for name in names if log.has(name))


def regimes_of(log: RunLog, signal: str, machine: MachineFile) -> tuple[tuple[str, NDArray[np.bool_]], ...]:
    """Return the regimes in which a signal is looked at, each with its samples, (n,)."""
    names, label = regime_labels(log, signal, machine)
    return tuple((name, label == number) for number, name in enumerate(names))


def _filled(values: Floats) -> Floats:
    """A series whose missing samples hold the last one there was."""
    there = np.isfinite(values)
    if there.all():
        return values
    last = np.maximum.accumulate(np.where(there, np.arange(len(values)), -1))
    return np.asarray(values[np.where(last < 0, int(np.argmax(there)), last)])


def _rapid(t_s: Floats, reference_mm: Floats, label: NDArray[np.int8], machine: MachineFile) -> NDArray[np.bool_]:
    """Return True where an axis keeps the rapid traverse, (n,)."""
    constant = (label == Regime.CONSTANT_MINUS) | (label == Regime.CONSTANT_PLUS)
    if machine.program is None or not constant.any():
        return np.zeros(len(t_s), dtype=bool)
    fast = np.abs(np.gradient(reference_mm, t_s)) >= RAPID_PART * machine.program.rapid_mm_min / 60.0
    return np.asarray(constant & fast)


def _still(log: RunLog) -> NDArray[np.bool_]:
    """Return True where no axis is told to move, (n,); nowhere in a run that does not say."""
    references = [_filled(log[name]) for name in (f"{a}_ref_mm" for a in log.axes()) if log.has(name)]
    if len(log) < 2:
        return np.zeros(len(log), dtype=bool)
    if references:
        speed = np.max([np.abs(np.gradient(reference, log.t_s)) for reference in references], axis=0)
        return np.asarray(speed < MOTION_MM_S)
    return np.asarray(log.columns["feed_mm_min"] == 0.0) if log.has("feed_mm_min") else np.zeros(len(log), dtype=bool)


def _ramp(log: RunLog) -> NDArray[np.bool_]:
    """Return True where the speed of the spindle is another than a tenth of a second before, (n,)."""
    if not log.has("spindle_rpm"):
        return np.zeros(len(log), dtype=bool)
    rpm = _filled(log["spindle_rpm"])
    before = np.maximum(np.searchsorted(log.t_s, log.t_s - RAMP_S), 0)
    before = np.minimum(before, np.maximum(np.arange(len(rpm)) - 1, 0))
    return np.asarray(np.abs(rpm - rpm[before]) > RAMP_PART * max(float(np.max(np.abs(rpm))), 1.0))
