"""Looks a case over before anything is computed: what is missing, not evenly sampled, too slow, or contradicts itself.

What can be mended is, and said; what cannot be used is left out, and said. Nothing is filled in: between slow samples the
reference is only taken where it goes on evenly, and only there are samples compared.
"""

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twin.case import Case, Run, RunKind
from twin.errors import RunLogError
from twin.gap_table import measured_signals
from twin.response import period_of
from twin.runlog import AXIS_COLUMN, RunLog

Floats = NDArray[np.float64]
SLOW = 1.5
"""Periods of the servo loops above which a recording is a slow one."""
JITTER = 0.2
CONTRADICTION = 0.3
"""Part of what a signal does by which repeated runs may not differ."""
NOT_WHEN_SLOW = frozenset(
    {
        *("presliding", "command_delay", "acceleration_feedforward", "payload", "velocity_feedback_delay", "torque_ripple"),
        *("torque_limit", "lead_error", "sensor_lag", "runout", "helix", "load_peak_hold"),
    }
)
"""Effects that show within a few milliseconds, or while an axis accelerates."""


class MendedRun(Run):
    """A run whose recording was mended."""

    def __init__(self, run: Run, log: RunLog) -> None:
        super().__init__(run.entry, run.folder)
        object.__setattr__(self, "_mended", log)

    @cached_property
    def log(self) -> RunLog:
        """Its recording, mended."""
        return self._mended  # type: ignore[attr-defined,no-any-return]


def inspected(case: Case) -> tuple[Case, tuple[str, ...]]:
    """The case as it can be used, and what was found, a sentence each.

    Raises RunLogError where a recording cannot be read at all.
    """
    notes: list[str] = []
    runs = tuple(run if run.entry.kind is RunKind.PROGRAM else _mended(run, case, notes) for run in case.runs)
    looked = Case(case.name, case.machine, runs)
    for one, other in looked.repeats():
        why = _contradiction(one, other)
        if why:
            notes.append(f"{other.name} is said to repeat {one.name}, but {why}; the two are not taken for repeats")
            entry = other.entry.model_copy(update={"repeats": None})
            runs = tuple(_with_entry(r, entry) if r is other else r for r in runs)
    if not case.repeats() and any(run.entry.kind in (RunKind.AIR, RunKind.CUT) for run in runs):
        notes.append("no run was repeated: the floor is what laps of a run or its sensors show, and chance counts as gap")
    if not case.of(role="check"):
        notes.append("no run of role check: this is judged on the runs that were fitted, which flatters")
    return Case(case.name, case.machine, runs), tuple(notes)


def slow_effects(case: Case) -> frozenset[str]:
    """Effects that recordings as slow as these cannot show."""
    periods = [_period_s(run.log) for run in case.of(role="fit") if run.entry.kind is not RunKind.PROGRAM and run.log.axes()]
    return NOT_WHEN_SLOW if any(isinstance(r, MendedRun) and _was_slow(r) for r in case.runs) and periods else frozenset()


def _was_slow(run: Run) -> bool:
    return getattr(run, "_slow", False)


def _period_s(log: RunLog) -> float:
    return float(np.median(np.diff(log.t_s))) if len(log) > 1 else 0.0


def _mended(run: Run, case: Case, notes: list[str]) -> Run:
    log = run.log
    if not log.axes():
        return run
    period_s, recorded_s = case.machine.machine.servo_period_s, _period_s(log)
    for name in measured_signals(log):
        missing = int(np.isnan(log[name]).sum())
        if missing > 0.01 * len(log) and recorded_s < SLOW * period_s:
            notes.append(f"{run.name}: {name} has no value in {missing} of {len(log)} samples; they are left out")
    even = np.abs(np.diff(log.t_s) - recorded_s).max(initial=0.0) <= JITTER * recorded_s
    if recorded_s <= SLOW * period_s and even and abs(period_of(log.t_s) - period_s) <= 0.01 * period_s and _whole(log):
        return run
    if recorded_s < 0.5 * period_s:
        raise RunLogError(
            f"{run.name}: is sampled every {1000 * recorded_s:.4g} ms, the servo loops tick every {1000 * period_s:.4g} ms; "
            "record at the servo period or slower, or state servo_period_s"
        )
    slow = recorded_s > SLOW * period_s
    if slow:
        notes.append(
            f"{run.name}: is sampled every {1000 * recorded_s:.4g} ms, the loops tick every {1000 * period_s:.4g} ms: compared "
            "where the reference stands or goes on evenly; what happens within a sample is not seen"
        )
    elif not even:
        notes.append(f"{run.name}: has gaps between its samples; the reference is interpolated there and nothing compared")
    mended = MendedRun(run, _on_servo_ticks(log, period_s, slow))
    object.__setattr__(mended, "_slow", slow)
    return mended


def _whole(log: RunLog) -> bool:
    return all(np.isfinite(v).all() for n, v in log.columns.items() if n.endswith("_ref_mm"))


def _on_servo_ticks(log: RunLog, period_s: float, slow: bool) -> RunLog:
    """The same recording on the ticks of the servo loops; NaN where there was no sample, or where it can't be compared."""
    ticks = np.arange(round((log.t_s[-1] - log.t_s[0]) / period_s) + 1)
    place = np.round((log.t_s - log.t_s[0]) / period_s).astype(np.intp)
    columns: dict[str, Floats] = {}
    for name, values in log.columns.items():
        match = AXIS_COLUMN.match(name)
        if match and match[2] == "ref_mm":
            known = np.isfinite(values)
            columns[name] = np.interp(ticks, place[known], values[known])
            continue
        if not match and name in ("spindle_rpm", "coolant_on", "ambient_temp_c", "axial_depth_mm", "line"):
            columns[name] = values[np.clip(np.searchsorted(place, ticks, side="right") - 1, 0, len(values) - 1)]
            continue
        if slow and not match:
            continue  # forces and the spindle's angle mean nothing at this rate
        kept = values.copy()
        if slow and match:
            kept[~_even_here(log.columns.get(f"{match[1]}_ref_mm"), len(values))] = np.nan
        column = np.full(len(ticks), np.nan)
        column[place] = kept
        columns[name] = column
    return RunLog(log.t_s[0] + ticks * period_s, columns, {}, log.ignored, log.source)


def _even_here(reference: Floats | None, count: int) -> NDArray[np.bool_]:
    """Where the reference has gone on evenly for three samples and does for one more."""
    if reference is None or count < 6:
        return np.zeros(count, dtype=bool)
    bend = np.concatenate([[0.0], np.abs(np.diff(reference, 2)), [0.0]])
    smooth = bend < 1e-3 + 1e-3 * np.abs(np.gradient(reference))
    even = smooth.copy()
    for back in (1, 2, 3):
        even[back:] &= smooth[:-back]
        even[:back] = False
    even[:-1] &= smooth[1:]
    return even


def _contradiction(one: Run, other: Run) -> str:
    """Why two runs are no repeats of each other; empty where they are."""
    a, b = one.log, other.log
    if len(a) != len(b):
        return "" if abs(len(a) - len(b)) < 0.02 * len(a) else f"they are {len(a)} and {len(b)} samples long"
    for name in a.columns:
        match = AXIS_COLUMN.match(name)
        if match and match[2] == "ref_mm" and name in b.columns:
            apart = float(np.nanmax(np.abs(a[name] - b[name])))
            if apart > 0.01 + 1e-3 * float(np.ptp(a[name])):
                return f"their {name} are up to {apart:.3g} mm apart"
    for name in measured_signals(a):
        if not b.has(name):
            continue
        match = AXIS_COLUMN.match(name)
        base = a.columns.get(f"{match[1]}_ref_mm") if match and match[2] != "torque_a" else None
        does = a[name] - (base if base is not None else np.nanmean(a[name]))
        size, apart = (float(np.sqrt(np.nanmean(v**2))) for v in (does, a[name] - b[name]))
        if apart > CONTRADICTION * size and apart > 20.0 * float(np.nanmedian(np.abs(np.diff(a[name], 2)))) and apart > 1e-3:
            return f"their {name} differ by {apart:.3g} rms, {100 * apart / max(size, 1e-12):.0f} % of what it does"
    return ""


def _with_entry(run: Run, entry: object) -> Run:
    if isinstance(run, MendedRun):
        changed = MendedRun(replace(run, entry=entry), run.log)  # type: ignore[arg-type]
        object.__setattr__(changed, "_slow", _was_slow(run))
        return changed
    return replace(run, entry=entry)  # type: ignore[arg-type]
