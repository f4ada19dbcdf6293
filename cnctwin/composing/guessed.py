"""A guess at a recording by its columns: the kind of run, and the recordings that it repeats."""

import numpy as np
from numpy.typing import NDArray

from twin.case import RunKind
from twin.runlog import AXIS_COLUMN, RunLog

SAME_LENGTH = 0.02
"""Part of its length by which a repeated recording may be longer."""
REFERENCE_MM, REFERENCE_PART = 0.01, 1e-3
SPEED_PART, START_K = 0.02, 0.5
Floats = NDArray[np.float64]


def kind_of(log: RunLog, *, has_program: bool) -> tuple[RunKind | None, str]:
    """Return the kind of run that a recording seems to be, and by what; None where its columns do not tell.

    >>> from twin.runlog import run_log
    >>> kind_of(run_log({"t_s": np.arange(3.0), "x_ref_mm": np.arange(3.0)}), has_program=False)
    (<RunKind.AIR: 'air'>, 'x_ref_mm and nothing that cuts')
    """
    cuts = next((c for c in ("force_x_n", "force_y_n") if log.has(c)), "")
    if not cuts and log.has("axial_depth_mm") and np.nanmax(log["axial_depth_mm"]) > 0.0:
        cuts = "axial_depth_mm"
    if cuts:
        return RunKind.CUT, cuts
    if axis := next((c for c in log.columns if AXIS_COLUMN.match(c) and log.has(c)), ""):
        return RunKind.AIR, f"{axis} and nothing that cuts"
    if log.has("line") and has_program:
        return RunKind.PROGRAM, "line, and the program that it ran"
    if log.has("spindle_temp_c"):
        return RunKind.WARMUP, "spindle_temp_c and no axis"
    if log.has("line"):
        return RunKind.PROGRAM, "line and no axis"
    if log.has("spindle_load_pct", "spindle_rpm"):
        return RunKind.AIR, "spindle_load_pct, and neither axis nor temperature"
    return None, ""


def is_repeat(one: RunLog, other: RunLog, kind: RunKind) -> bool:
    """Return True where two recordings of a kind went through the same: references, lines, or speeds from the same start."""
    if abs(len(one) - len(other)) > SAME_LENGTH * max(len(one), len(other)):
        return False
    if kind is RunKind.PROGRAM:
        return _same_lines(one, other)
    references = [c for c in one.columns if (m := AXIS_COLUMN.match(c)) and m[2] == "ref_mm"]
    if references:
        return all(other.has(c) for c in references) and all(near_references(one[c], other[c]) for c in references)
    if kind is not RunKind.WARMUP or not (one.has("spindle_rpm") and other.has("spindle_rpm")):
        return False
    a, b = _first(one["spindle_rpm"], other["spindle_rpm"])
    starts = [log["spindle_temp_c"][np.isfinite(log["spindle_temp_c"])][0] for log in (one, other)]
    apart = float(np.sqrt(np.nanmean((a - b) ** 2)))
    return apart <= SPEED_PART * max(float(np.nanmax(np.abs(a))), 1.0) and abs(starts[0] - starts[1]) <= START_K


def _same_lines(one: RunLog, other: RunLog) -> bool:
    if not (one.has("line") and other.has("line")):
        return False
    lasted = [float(log.t_s[-1] - log.t_s[0]) for log in (one, other)]
    ends = [float(np.nanmax(log["line"])) for log in (one, other)]
    return ends[0] == ends[1] and abs(lasted[0] - lasted[1]) <= SAME_LENGTH * max(lasted)


def near_references(one: Floats, other: Floats) -> bool:
    """Return True where two references never lie further apart than what resolution and rounding make."""
    a, b = _first(one, other)
    apart = np.abs(a - b)
    if not np.isfinite(apart).any():
        return False
    return float(np.nanmax(apart)) <= REFERENCE_MM + REFERENCE_PART * float(np.nanmax(a) - np.nanmin(a))


def _first(one: Floats, other: Floats) -> tuple[Floats, Floats]:
    count = min(len(one), len(other))
    return one[:count], other[:count]
