"""The twin's inputs from a recorded run: those of the response, the states it starts from, the noise of its sensors."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from twin.errors import RunLogError
from twin.machine import Axis, MachineFile
from twin.runlog import RunLog
from twin.simulator.response import RunInput, noise_key, period_of

Floats = NDArray[np.float64]

STILL_MIN = 20
"""Samples of standstill at the start of a run that are worth averaging."""
SETTLED = 50
"""Samples in which an axis that stands moves by less than its sensor sees."""


def told_of(log: RunLog, machine: MachineFile) -> RunInput:
    """Return what the machine was commanded in a recorded run.

    Raises RunLogError where an axis of the machine is recorded at another period than the one its loops tick with.
    """
    letters = [a for a in log.axes() if f"{a}_ref_mm" in log.columns]
    period_s = machine.machine.servo_period_s
    if letters and abs(period_of(log.t_s) - period_s) > 0.01 * period_s:
        raise RunLogError(
            f"{log.source}: is sampled every {1000 * period_of(log.t_s):.4g} ms, the servo loops tick every "
            f"{1000 * period_s:.4g} ms; record at the servo period"
        )

    def column(name: str) -> Floats | None:
        return log.columns.get(name) if log.has(name) else None

    return RunInput(
        t_s=log.t_s,
        reference_mm={a: log[f"{a}_ref_mm"] for a in letters},
        spindle_rpm=column("spindle_rpm"),
        spindle_angle_rad=column("spindle_angle_rad"),
        axial_depth_mm=column("axial_depth_mm"),
        entry_angle_rad=column("entry_angle_rad"),
        exit_angle_rad=column("exit_angle_rad"),
        coolant_on=column("coolant_on"),
        ambient_temp_c=column("ambient_temp_c"),
        start={a: start_of(log, a, machine.axes[a], period_s) for a in letters if a in machine.axes},
        tool=tool_of(log, machine),
        start_temp_c=start_temperature_c(log.t_s, log["spindle_temp_c"]) if log.has("spindle_temp_c") else None,
    )


def tool_of(log: RunLog, machine: MachineFile) -> str:
    """The number of the tool that is in the spindle while a run cuts, of those that the machine describes; empty for [tool].

    Empty as well where a run cuts with several, or does not say with which of several.
    """
    if not machine.tools:
        return ""
    if not log.has("tool_number"):
        return next(iter(machine.tools)) if len(machine.tools) == 1 else ""
    number = log["tool_number"]
    cutting = np.nan_to_num(log.columns.get("axial_depth_mm", np.zeros(len(log)))) > 0.0
    there = np.isfinite(number)
    used = {str(int(n)) for n in np.unique(number[there & cutting if (there & cutting).any() else there])}
    return used.pop() if len(used) == 1 and used <= set(machine.tools) else ""


def start_of(log: RunLog, letter: str, axis: Axis, period_s: float) -> Mapping[str, float]:
    """The state of an axis at the first sample of a run."""
    has = f"{letter}_pos_mm" in log.columns and f"{letter}_torque_a" in log.columns
    cutting = np.flatnonzero(np.nan_to_num(log.columns.get("axial_depth_mm", np.zeros(1))) > 0.0)
    # a waiting axis is pushed as soon as another one cuts
    pushed = int(cutting[0]) if len(cutting) and letter in "xy" and cutting[0] >= STILL_MIN else len(log)
    return start_state(
        axis,
        log[f"{letter}_ref_mm"][:pushed],
        (log[f"{letter}_pos_mm"] if has else log[f"{letter}_ref_mm"])[:pushed],
        log[f"{letter}_torque_a"][:pushed] if has else np.zeros(pushed),
        period_s,
    )


def start_state(axis: Axis, reference_mm: Floats, position_mm: Floats, torque_a: Floats, period_s: float) -> Mapping[str, float]:
    """The state at the first of (n,) samples: the mean of a standstill there, else a parabola through the first ones.

    Where there are none, the axis is taken to be where it should be.
    """
    moving = np.flatnonzero(np.diff(reference_mm) != 0)
    still = int(moving[0]) if len(moving) else len(reference_mm)
    if still >= STILL_MIN or len(reference_mm) < 12:
        here = slice(0, still + 1)  # it still stands where the reference begins to move
        position, velocity, step = _standing_mm(_known(position_mm[here], reference_mm[:1])), 0.0, 0.0
        torque = float(np.mean(_known(torque_a[here], np.zeros(1))[:SETTLED]))
    else:
        first = np.arange(12) * period_s
        lagging = _filled(position_mm[:12], reference_mm[:12])
        _, velocity, position = (float(v) for v in np.polyfit(first, lagging, 2))
        torque = float(np.polyfit(first, _filled(torque_a[:12], np.zeros(12)), 1)[1])
        step = float(reference_mm[1] - reference_mm[0])
    error = axis.position_gain_per_s * (float(reference_mm[0]) - position) - velocity
    integral = torque - axis.velocity_gain_a_s_per_mm * error - axis.velocity_integral_gain_a_per_mm * error * period_s
    return {
        "position_mm": position,
        "velocity_mm_s": velocity,
        "integral_a": integral if axis.velocity_integral_gain_a_per_mm > 0 else 0.0,
        "previous_reference_mm": float(reference_mm[0]) - step,
        "previous_reference_velocity_mm_s": step / period_s,
    }


def _known(values: Floats, instead: Floats) -> Floats:
    """The samples that there are; `instead` where there are none."""
    there = np.isfinite(values)
    return np.asarray(values[there]) if there.any() else instead


def _filled(values: Floats, instead: Floats) -> Floats:
    """(n,) with what is missing taken from its neighbours; `instead` where there are none."""
    there = np.flatnonzero(np.isfinite(values))
    return np.interp(np.arange(len(values)), there, values[there]) if len(there) else instead


def _standing_mm(position_mm: Floats) -> float:
    """Return the position of an axis whose reference stands: the mean, or that of the first samples where it gave way later."""
    first, whole = float(np.mean(position_mm[:SETTLED])), float(np.mean(position_mm))
    certain = white_noise(position_mm) / np.sqrt(min(SETTLED, len(position_mm)))
    return first if abs(first - whole) > 5.0 * certain > 0.0 else whole


def start_temperature_c(t_s: Floats, temperature_c: Floats) -> float:
    """Temperature at the first sample: by a line through those of the first minute, or of the first hundredth of a short run."""
    there = np.flatnonzero(np.isfinite(temperature_c))
    first = there[t_s[there] <= t_s[there[0]] + min(60.0, 0.01 * float(t_s[-1] - t_s[0]))]
    if len(first) < 5:
        return float(temperature_c[there[0]])
    return float(np.polyfit(t_s[first] - t_s[0], temperature_c[first], 1)[1])


MEDIAN_TO_SIGMA = 1.482602218505602


def white_noise(values: Floats, order: int = 2, step: int = 1) -> float:
    """Return the standard deviation of the white part of a smooth signal, (n,): from its differences, robustly.

    order: of the differences; fourth ones have hardly any of a motion in them; step: samples over which they are taken

    >>> noisy = np.random.default_rng(1).standard_normal(20000) + np.linspace(0.0, 100.0, 20000)
    >>> bool(abs(white_noise(noisy) - 1.0) < 0.05)
    True
    """
    differences = values[np.isfinite(values)] if step == 1 else values
    for _ in range(order):
        differences = differences[step:] - differences[:-step]
    differences = differences[np.isfinite(differences)]
    if not len(differences):
        return 0.0
    spread = float(np.median(np.abs(differences - np.median(differences))))
    return spread * MEDIAN_TO_SIGMA / math.sqrt(math.comb(2 * order, order))


def resolution(values: Floats) -> float:
    """The step of a signal that is read in steps: the smallest between two of its values; 0 where all are one.

    >>> round(resolution(np.array([0.02, 0.02, 0.05, 0.03])), 6)
    0.01
    """
    levels = np.unique(values[np.isfinite(values)])
    steps = np.diff(levels)
    steps = steps[steps > 1e-7 * float(np.max(np.abs(levels), initial=0.0))]
    return float(steps.min()) if len(steps) else 0.0


def noise_of(machine: MachineFile, log: RunLog, column: str) -> float:
    """Noise of the sensor of a column: as the machine states it, else from the recording, never quite 0.

    Where most samples of a recording repeat the one before, its resolution r is the noise: r / √12.
    """
    stated = machine.noise.get(noise_key(machine, column) or column)
    found = stated if stated is not None else white_noise(log[column]) or resolution(log[column]) / np.sqrt(12.0)
    scale = float(np.nanmax(np.abs(log[column]))) if len(log) else 1.0
    return max(found, 1e-9 * max(scale, 1.0))
