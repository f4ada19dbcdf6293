"""The rows of a run from history: what a machine was told and said, held where a control reports changes only.

A long run is thinned: means over so many seconds of load, speed and feed, everything else as it was read at the beginning of
each. A mean of a temperature would hide the steps in which its sensor reads, by which its floor is known.
"""

import math
from collections.abc import Collection, Iterable

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
PERIODS_S = (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0)
MEANS = ("spindle_rpm", "spindle_load_pct", "spindle_power_kw", "feed_mm_min")


def rows_of(store: Store, machine: str, span_ms: Span, signals: Collection[str]) -> RunLog:
    """Return the run log of a stretch, a row for each time at which one of these signals said something. Raises StoreError."""
    return run_of(store, machine, *span_ms, held=True, only=signals)


def with_ambient(log: RunLog, ambient_c: float | None) -> RunLog:
    """Return the run log with surroundings of that temperature, where none are recorded."""
    if ambient_c is None or log.has("ambient_temp_c"):
        return log
    columns = {"t_s": log.t_s, **log.columns, **log.text, "ambient_temp_c": np.full(len(log), ambient_c)}
    return run_log(columns, log.source)


def thinned(log: RunLog, rows_max: int = ROWS_MAX) -> tuple[RunLog, float | None]:
    """Return a run log of so many rows at most, and the seconds that each of its means is over; None where nothing was thinned.

    A stretch of time in which nothing was told gets no row.
    """
    if len(log) <= rows_max:
        return log, None
    lasted = float(log.t_s[-1] - log.t_s[0])
    period_s = next((p for p in PERIODS_S if lasted / p < rows_max), math.ceil(lasted / rows_max))
    number = np.floor((log.t_s - log.t_s[0]) / period_s).astype(np.int64)
    first = np.flatnonzero(np.diff(number, prepend=-1))
    columns: dict[str, NDArray[np.generic]] = {"t_s": number[first] * period_s}
    at = np.searchsorted(log.t_s - log.t_s[0], columns["t_s"], side="right") - 1
    for name, values in log.columns.items():
        columns[name] = _means(log, values, columns["t_s"], period_s) if name in MEANS else values[at]
    return run_log(columns | {name: values[at] for name, values in log.text.items()}, log.source), period_s


def _means(log: RunLog, values: NDArray[np.float64], begin_s: Iterable[float], period_s: float) -> NDArray[np.float64]:
    """Return the mean over time in each window of what holds from row to row; NaN where it was not known in most of it."""
    t_s = log.t_s - log.t_s[0]
    begin = np.asarray(begin_s, dtype=np.float64)
    end = np.minimum(begin + period_s, max(float(t_s[-1]), float(begin[-1]) + 1e-9))
    known = np.isfinite(values)
    lasts = np.diff(t_s, append=t_s[-1])
    total = np.concatenate([[0.0], np.cumsum(np.where(known, values, 0.0) * lasts)])
    held = np.concatenate([[0.0], np.cumsum(known * lasts)])

    def until(t: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        row = np.clip(np.searchsorted(t_s, t, side="right") - 1, 0, len(t_s) - 1)
        since = (t - t_s[row]) * known[row]
        return total[row] + np.where(known[row], values[row], 0.0) * since, held[row] + since

    (sum_end, held_end), (sum_begin, held_begin) = until(end), until(begin)
    seconds = held_end - held_begin
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = (sum_end - sum_begin) / seconds
    row = np.searchsorted(t_s, begin, side="right") - 1
    return np.where(end - begin <= 1e-6, values[row], np.where(seconds > 0.5 * (end - begin), mean, np.nan))
