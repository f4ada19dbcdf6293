"""Feeds and speeds as a program can hold them: whole rev/min, feeds rounded down; every limit that was kept stays kept.

Lines that share a speed go on to share it, since a change would cost time.
"""

import numpy as np
from numpy.typing import NDArray

from twin.optimisation.closed_form import Worth
from twin.optimisation.forces import CutForces
from twin.optimisation.problem import Problem
from twin.optimisation.words import feed_figure, figure_mm_min

Floats = NDArray[np.float64]
SAME_RPM = 0.5
FULL = 1e-6
TRIMS_MAX = 200


def rounded(problem: Problem, feed: Floats, rpm: Floats, worth: Worth) -> tuple[Floats, Floats]:
    """Feed words and speeds (lines,) that can be written, in mm/min and rev/min."""
    allowed = problem.allowed
    speeds = rpm.copy()
    full = feed >= allowed.feed_max(rpm[None])[0] * (1.0 - FULL)
    rows = problem.cutting[np.argsort(rpm[problem.cutting], kind="stable")]
    group: list[int] = []
    for row in rows.tolist():
        if group and rpm[row] - rpm[group[0]] > SAME_RPM:
            _round_group(problem, group, speeds, worth)
            group = []
        group.append(row)
    if group:
        _round_group(problem, group, speeds, worth)
    most = allowed.feed_max(speeds[None])[0]
    chosen = _within_power(problem, np.where(full, most, np.minimum(feed, most)), speeds)
    inch = [problem.program.lines[int(k)].inch for k in allowed.index]
    written = np.array([figure_mm_min(feed_figure(float(f), i), i) for f, i in zip(chosen, inch, strict=True)], dtype=np.float64)
    return written.reshape(len(chosen)), speeds


def _within_power(problem: Problem, feed: Floats, rpm: Floats) -> Floats:
    """Feeds that keep the power by the force itself, where the table of `Allowed` was a little too kind."""
    allowed, forces = problem.allowed, CutForces.of(problem.program)
    if allowed.spindle is None or not len(forces.cuts):
        return feed
    rows = {int(k): row for row, k in enumerate(allowed.index)}
    own = np.array([rows.get(int(line), -1) for line in problem.program.cuts.line], dtype=np.int64)
    mine = np.flatnonzero(own >= 0)
    row = own[mine]
    allowed_w = allowed.spindle.allowed_cutting_w(rpm)
    chosen = feed.copy()
    for _ in range(TRIMS_MAX):
        advance = chosen[row] * allowed.feed_ratio / (allowed.teeth[row] * rpm[row])
        power_w = forces.tangential_n(advance, mine) * np.pi * forces.diameter_mm[mine] * rpm[row] / 60_000.0
        worst = np.zeros(len(feed))
        np.maximum.at(worst, row, power_w)
        over = allowed.cutting & (worst > allowed_w)
        if not over.any():
            break
        part = np.where(over, allowed_w / np.maximum(worst, 1e-12), 1.0)
        chosen = np.where(over, np.maximum(chosen * np.minimum(part, 1.0 - 1e-6), allowed.feed_low), chosen)
    return chosen


def _round_group(problem: Problem, group: list[int], speeds: Floats, worth: Worth) -> None:
    """One speed for lines that share one; each its own where no whole one suits all; to a hundredth where none suits a line."""
    allowed = problem.allowed
    middle = float(speeds[group].mean())
    whole = [n for n in (np.floor(middle), np.ceil(middle)) if all(_fits(problem, row, n) for row in group)]
    if whole:
        at = np.array([[n] * len(allowed) for n in whole])
        feeds = allowed.feed_max(at)
        value = [
            sum(float(worth.of_line(row, feeds[k, row : row + 1], at[k, row : row + 1])[0]) for row in group)
            for k in range(len(whole))
        ]
        speeds[group] = whole[int(np.argmin(value))]
    elif len(group) > 1:
        for row in group:
            _round_group(problem, [row], speeds, worth)
    else:
        row = group[0]
        near = [n for n in (np.floor(middle * 100) / 100, np.ceil(middle * 100) / 100) if _fits(problem, row, n)]
        speeds[row] = near[0] if near else middle


def _fits(problem: Problem, row: int, rpm: float) -> bool:
    return any(a - 1e-9 <= rpm <= b + 1e-9 for a, b in problem.allowed.spans[row])
