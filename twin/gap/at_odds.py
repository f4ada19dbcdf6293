"""Columns of a recording that contradict each other: another unit, another sign, a cut that
isn't known.

A column that cannot be what its name says is left out, and so is what depends on it: a force of the cut that nobody knows would
else be blamed on the axes that it pushes and the meter that shows it.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin.case import Run, RunKind
from twin.machine import MachineFile
from twin.runlog import AXIS_COLUMN, RunLog
from twin.simulator.recorded import told_of
from twin.simulator.response import milling_of

Floats = NDArray[np.float64]
OFF = 1.5
"""Factor by which a position may be off its reference before it is another unit."""
SHOWN_S = 0.2
"""For which a cut still shows in the load."""
TURN_RAD = 2.0 * np.pi
ENGAGEMENT = ("spindle_rpm", "spindle_angle_rad", "axial_depth_mm", "entry_angle_rad", "exit_angle_rad")


def without_axes_at_odds(run: Run, log: RunLog, notes: list[str]) -> RunLog:
    """Without the axes whose positions agree with each other and not with the reference: then it is that which is wrong."""
    dropped: set[str] = set()
    for letter in log.axes():
        reference = f"{letter}_ref_mm"
        slopes = {
            name: slope
            for name in (f"{letter}_pos_mm", f"{letter}_table_mm")
            if log.has(name, reference) and _off(slope := _slope(log[reference], log[name]))
        }
        if not slopes:
            continue
        said = " and ".join(f"{name} goes {slope:.4g} mm" for name, slope in slopes.items())
        both = len(slopes) > 1 and max(slopes.values()) - min(slopes.values()) < 0.01 * abs(max(slopes.values(), key=abs))
        notes.append(
            f"{run.name}: {said} for each mm of {reference}: "
            + (f"{reference} has another unit or sign, and axis {letter} is left out" if both else "another unit or sign")
        )
        if both:
            dropped |= {name for name in log.columns if (m := AXIS_COLUMN.match(name)) and m[1] == letter}
    return _without(log, dropped)


def without_axes_of_another_kind(run: Run, log: RunLog, machine: MachineFile, notes: list[str]) -> RunLog:
    """Without the axes that are recorded in degrees and stated as linear ones, or the other way round."""
    dropped: set[str] = set()
    for letter, axis in machine.axes.items():
        own = [name for name in log.columns if (m := AXIS_COLUMN.match(name)) and m[1] == letter]
        if axis.is_rotary is not (letter in log.rotary) and any(name.endswith("_mm") for name in own):
            recorded, stated = ("degrees", "a linear") if letter in log.rotary else ("mm", "a rotary")
            notes.append(
                f"{run.name}: {letter} is recorded in {recorded}, and axes.{letter} is {stated} axis: it is not compared"
            )
            dropped |= set(own)
    return _without(log, dropped)


def _off(slope: float) -> bool:
    return np.isfinite(slope) and not 1.0 / OFF < slope < OFF


def _slope(reference: Floats, values: Floats) -> float:
    """Return the slope of values over the reference; NaN where it does not move, or the values do something else."""
    known = np.isfinite(reference) & np.isfinite(values)
    if known.sum() < 100 or np.ptp(reference[known]) < 1e-9:
        return float("nan")
    x, y = reference[known] - np.median(reference[known]), values[known] - np.median(values[known])
    tight = np.abs(y) <= 3.0 * float(np.quantile(np.abs(y), 0.99))  # spikes say nothing of a unit
    moved = float(np.sum(x[tight] ** 2))
    # a sensor that sees nothing of the motion has no unit to speak of
    slope = float(np.sum(x[tight] * y[tight])) / moved if moved > 0.0 else float("nan")
    return slope if abs(slope) * np.std(x[tight]) > 0.9 * np.std(y[tight]) > 0.0 else float("nan")


def with_known_cut(run: Run, log: RunLog, machine: MachineFile, notes: list[str]) -> RunLog:
    """Without what a cut shows where the force of it can't be known."""
    columns, bad = dict(log.columns), _engagement_at_odds(run, log, notes)
    for name in bad:
        del columns[name]
    cleaned = replace(log, columns=columns)
    cuts = run.entry.kind is RunKind.CUT or bool((np.nan_to_num(log.columns.get("axial_depth_mm", np.zeros(1))) > 0.0).any())
    if not cuts or (machine.tool is not None and milling_of(told_of(cleaned, machine)) is not None):
        return cleaned
    depth = cleaned.columns.get("axial_depth_mm")
    cutting = np.ones(len(log), dtype=bool) if depth is None else _around(np.nan_to_num(depth) > 0.0, log.t_s)
    needs = [name for name in (*ENGAGEMENT, "x_ref_mm", "y_ref_mm") if not cleaned.has(name)]
    missing = ([] if machine.tool else ["[tool]"]) + needs
    hidden = [name for name in columns if name[:2] in ("x_", "y_") and not name.endswith("_ref_mm")]
    hidden += [name for name in ("spindle_load_pct", "force_x_n", "force_y_n") if name in columns]
    if missing and hidden and cutting.any():
        notes.append(
            f"{run.name}: the force of the cut is not known without {', '.join(missing)}: where it cuts, x, y and the "
            "spindle's load are not compared"
        )
        columns |= {name: np.where(cutting, np.nan, columns[name]) for name in hidden}
    return replace(log, columns=columns)


def _around(here: NDArray[np.bool_], t_s: Floats) -> NDArray[np.bool_]:
    """Return what is so within SHOWN_S before or after: a meter shows the mean of what was."""
    width = round(SHOWN_S / max(float(np.median(np.diff(t_s))), 1e-9))
    return np.asarray(np.convolve(here, np.ones(2 * width + 1), mode="same")[: len(here)] > 0.5)


def _engagement_at_odds(run: Run, log: RunLog, notes: list[str]) -> list[str]:
    """Columns of the engagement that cannot be what they are called."""
    bad = []
    for name in ("entry_angle_rad", "exit_angle_rad"):
        if log.has(name) and (np.nanmax(log[name]) > TURN_RAD + 0.1 or np.nanmin(log[name]) < -TURN_RAD - 0.1):
            notes.append(f"{run.name}: {name} goes up to {np.nanmax(np.abs(log[name])):.4g}, more than a turn; give it in rad")
            bad.append(name)
    for name in ("axial_depth_mm", "spindle_rpm"):
        if log.has(name) and np.nanmin(log[name]) < 0.0:
            notes.append(f"{run.name}: {name} is negative, down to {np.nanmin(log[name]):.4g}; it counts as not recorded")
            bad.append(name)
    if log.has("spindle_angle_rad", "spindle_rpm") and "spindle_rpm" not in bad and len(log) > 2:
        step = float(np.median(np.diff(log.t_s)))
        turned = np.diff(log["spindle_angle_rad"])
        expected = TURN_RAD / 60.0 * log["spindle_rpm"][1:] * step
        away = np.abs((turned - expected + np.pi) % TURN_RAD - np.pi)
        typical = float(np.nanmedian(away)) if np.isfinite(away).any() else 0.0
        if typical > 0.1 + 0.05 * float(np.nanmedian(np.abs(expected))):
            notes.append(
                f"{run.name}: spindle_angle_rad and spindle_rpm do not turn together, {typical:.2g} rad apart each sample; "
                "one of them has another unit, and the angle counts as not recorded"
            )
            bad.append("spindle_angle_rad")
    return bad


def _without(log: RunLog, names: set[str]) -> RunLog:
    if not names:
        return log
    return replace(log, columns={n: v for n, v in log.columns.items() if n not in names})
