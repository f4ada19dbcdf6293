"""Run logs as streams at a steady period, with the changes that are known in them.

A change is known where `tool_change_active` rises, or a new `tool_number` comes without it; where a person gives times, at these
only. Where the control tells nothing for longer than HOLE_S, the stream ends, and another begins.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cnctwin.errors import UsageError
from twin.errors import RunLogError
from twin.runlog import RunLog, read_run
from twin.transient.stream import Stream, held, resting, standing

Floats = NDArray[np.float64]
HOLE_S = 600.0
SAME_CHANGE_S = 5.0
"""A new number so soon after the flag was up, or after another number, is the same change."""
SAMPLES_MAX = 20_000_000


def streams_of(paths: Sequence[Path], signal: str, period_s: float, given_s: Sequence[float]) -> list[Stream]:
    """The streams of run logs; times given are those of the first run. Raises UsageError where they do not have the signal."""
    streams: list[Stream] = []
    for number, path in enumerate(paths):
        try:
            run = read_run(path)
        except RunLogError as error:
            raise UsageError(str(error)) from None
        if not run.has(signal):
            raise UsageError(f"{path}: there is no {signal} in it; there are {', '.join(run.columns)}")
        if (run.t_s[-1] - run.t_s[0]) / period_s > SAMPLES_MAX:
            raise UsageError(f"{path}: more than {SAMPLES_MAX} samples at every {period_s:g} s; sample coarser with --period")
        at_s = given_s if number == 0 else ()
        if outside := [at for at in at_s if not run.t_s[0] <= at <= run.t_s[-1]]:
            raise UsageError(f"{path}: --at {outside[0]:g} is outside of it; it runs from {run.t_s[0]:g} to {run.t_s[-1]:g} s")
        streams += streams_of_run(run, path.name, signal, period_s, at_s)
    return streams


def known_changes(run: RunLog) -> list[float]:
    """Times at which the run log says that a tool was changed."""
    times: list[float] = []
    flagged_s = np.array([-np.inf])
    if "tool_change_active" in run.columns:
        active = np.nan_to_num(run["tool_change_active"]) > 0.0
        times += run.t_s[1:][active[1:] & ~active[:-1]].tolist()
        times += run.t_s[:1][active[:1]].tolist()
        flagged_s = np.append(flagged_s, run.t_s[active])
    if "tool_number" in run.columns:
        number = run["tool_number"]
        is_tool = np.isfinite(number) & (number > 0.0)
        t_s, tools = run.t_s[is_tool], number[is_tool]
        new_s = t_s[1:][np.diff(tools) != 0.0]
        since_flag_s = new_s - flagged_s[np.searchsorted(flagged_s, new_s, side="right") - 1]
        times += new_s[since_flag_s > SAME_CHANGE_S].tolist()
    kept: list[float] = []
    for at_s in sorted(times):
        if not kept or at_s - kept[-1] > SAME_CHANGE_S:
            kept.append(at_s)
    return kept


def streams_of_run(run: RunLog, source: str, signal: str, period_s: float, given_s: Sequence[float]) -> list[Stream]:
    """The streams of one run, with the changes that are given, else those that it knows."""
    changes_s = list(given_s) or known_changes(run)
    cuts = np.flatnonzero(np.diff(run.t_s) > HOLE_S) + 1
    streams = []
    for first, last in zip([0, *cuts.tolist()], [*cuts.tolist(), len(run)], strict=True):
        t_s = run.t_s[first:last]
        grid_s = np.arange(np.ceil(t_s[0] / period_s), np.floor(t_s[-1] / period_s) + 1.0) * period_s
        values = sampled(t_s, run[signal][first:last], grid_s, period_s)
        known = np.flatnonzero(np.isfinite(values))
        if not len(known):
            continue
        grid_s, values = grid_s[known[0] :], values[known[0] :]
        feed, block = (
            held(t_s, run[name][first:last], grid_s) if name in run.columns else np.full(len(grid_s), np.nan)
            for name in ("feed_mm_min", "line")
        )
        within = tuple(sorted(at for at in changes_s if grid_s[0] <= at <= t_s[-1]))
        streams.append(Stream(period_s, float(grid_s[0]), values, resting(feed), standing(block), within, source))
    return streams


def sampled(t_s: Floats, values: Floats, grid_s: Floats, period_s: float) -> Floats:
    """The signal on the grid: the mean of what came within a period where several did, else the last that came."""
    at = held(t_s, values, grid_s)
    known = np.isfinite(values)
    slot = np.searchsorted(grid_s, t_s[known], side="left")
    inside = slot < len(grid_s)
    counts = np.bincount(slot[inside], minlength=len(grid_s))
    sums = np.bincount(slot[inside], weights=values[known][inside], minlength=len(grid_s))
    dense = counts > 1
    if np.median(np.diff(t_s[known])) < period_s / 1.5 if known.sum() > 1 else False:
        at[dense] = sums[dense] / counts[dense]
    return at
