"""The rows of a run from history: what a machine was told and said, held where a control reports changes only.

Where nothing changed for a while, a row says that every so often: what was told last holds there, and it is no hole. A long run
is thinned to even windows, in which it is heated as it was:

    n = mean of n,   load = mean (load n²) / mean n²,   feed and power as their means

Everything else is as it was read at the beginning of each. A mean of a temperature would hide the steps in which its sensor
reads, by which its floor is known.
"""

import math
from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cnctwin.composing.history import Span
from cnctwin.memory.store.contract import Store
from cnctwin.memory.store.run_export import run_of
from twin.runlog import RunLog, run_log

HEAT = ("spindle_rpm", "spindle_load_pct", "spindle_temp_c", "ambient_temp_c", "coolant_on")
WORK = (*HEAT, "feed_mm_min", "tool_change_active", "exec_state")
"""Signals of a stretch: what heats, what cools, and when the spindle turns in air."""
EXECUTED = (
    *("nc_line", "feed_mm_min", "exec_state", "program", "tool_number", "tool_change_active", "spindle_rpm", "spindle_load_pct"),
    *("spindle_rpm_cmd", "spindle_power_kw", "feed_override_pct", "rapid_override_pct", "spindle_override_pct", "coolant_on"),
)
"""Signals of a program that was run."""
ROWS_MAX = 12_000
PERIODS_S = (0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0, 60.0)
UNCHANGED_S = 20.0
"""Seconds without a change after which a row says that nothing has changed."""
RPM, LOAD = "spindle_rpm", "spindle_load_pct"
MEANS = (RPM, "spindle_power_kw", "feed_mm_min")
Floats = NDArray[np.float64]


def rows_of(store: Store, machine: str, span_ms: Span, signals: Collection[str]) -> RunLog:
    """Return the run log of a stretch, a row for each time at which one of these signals said something. Raises StoreError."""
    return run_of(store, machine, *span_ms, held=True, only=signals)


def with_ambient(log: RunLog, ambient_c: float | None) -> RunLog:
    """Return the run log with surroundings of that temperature, where none are recorded."""
    if ambient_c is None or log.has("ambient_temp_c"):
        return log
    columns = {"t_s": log.t_s, **log.columns, **log.text, "ambient_temp_c": np.full(len(log), ambient_c)}
    return run_log(columns, log.source)


def unbroken(log: RunLog) -> RunLog:
    """Return the run log with a row every 20 s at least: what was told last holds until something else is told."""
    gaps = np.diff(log.t_s)
    more = [log.t_s[n] + UNCHANGED_S * np.arange(1, math.ceil(gaps[n] / UNCHANGED_S)) for n in np.flatnonzero(gaps > UNCHANGED_S)]
    return _at(log, np.sort(np.concatenate([log.t_s, *more]))) if more else log


def thinned(log: RunLog, rows_max: int = ROWS_MAX) -> tuple[RunLog, float | None]:
    """Return a run log of so many rows at most, and the seconds of each of its windows; None where nothing was thinned."""
    if len(log) <= rows_max:
        return log, None
    lasted = float(log.t_s[-1] - log.t_s[0])
    period_s = next((p for p in PERIODS_S if lasted / p < rows_max), math.ceil(lasted / rows_max))
    begin_s = log.t_s[0] + period_s * np.arange(math.floor(lasted / period_s) + 1)
    thin = _at(log, begin_s)
    means = {name: _means(log, log[name], begin_s, period_s) for name in MEANS if name in log.columns}
    if LOAD in log.columns:
        weight = log[RPM] ** 2 if RPM in log.columns else np.ones(len(log))
        heating, turning = (_means(log, values, begin_s, period_s) for values in (log[LOAD] * weight, weight))
        plain = _means(log, log[LOAD], begin_s, period_s)
        means[LOAD] = np.divide(heating, turning, out=plain, where=turning > 0.0)
    return replace(thin, columns=dict(thin.columns) | means), period_s


def _at(log: RunLog, t_s: Floats) -> RunLog:
    """Return the rows that hold at these times."""
    row = np.searchsorted(log.t_s, t_s, side="right") - 1
    columns = {name: values[row] for name, values in log.columns.items()}
    return replace(log, t_s=t_s - t_s[0], columns=columns, text={name: values[row] for name, values in log.text.items()})


def _means(log: RunLog, values: Floats, begin_s: Floats, period_s: float) -> Floats:
    """Return the mean over time in each window of what holds from row to row; NaN where it was not known in most of it."""
    end_s = np.minimum(begin_s + period_s, log.t_s[-1])
    known = np.isfinite(values)
    lasts = np.diff(log.t_s, append=log.t_s[-1])
    total = np.concatenate([[0.0], np.cumsum(np.where(known, values, 0.0) * lasts)])
    held = np.concatenate([[0.0], np.cumsum(known * lasts)])

    def until(t_s: Floats) -> tuple[Floats, Floats]:
        row = np.searchsorted(log.t_s, t_s, side="right") - 1
        since = (t_s - log.t_s[row]) * known[row]
        return total[row] + np.where(known[row], values[row], 0.0) * since, held[row] + since

    (sum_end, held_end), (sum_begin, held_begin) = until(end_s), until(begin_s)
    seconds = held_end - held_begin
    row = np.searchsorted(log.t_s, begin_s, side="right") - 1
    mean = np.divide(sum_end - sum_begin, seconds, out=np.full(len(begin_s), np.nan), where=seconds > 0.5 * (end_s - begin_s))
    return np.where(end_s <= begin_s, values[row], mean)
