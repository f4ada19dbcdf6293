"""Feeds and speeds as a program can hold them: whole rev/min, feeds rounded down; every limit that was kept stays kept.

Groups that have the same speed go on to have it, since a change would cost time.
"""

import numpy as np
from numpy.typing import NDArray

from twin.optimisation.closed_form import Worth
from twin.optimisation.forces import CutForces
from twin.optimisation.problem import Problem

Floats = NDArray[np.float64]
SAME_RPM = 0.5
FULL = 1e-6
TRIMS_MAX = 200


def rounded(problem: Problem, feed: Floats, rpm: Floats, worth: Worth) -> tuple[Floats, Floats]:
    """Feed words and speeds (lines,) that can be written, in mm/min and rev/min."""
    allowed = problem.allowed
    speeds = rpm.copy()
    full = feed >= allowed.feed_max(rpm[None])[0] * (1.0 - FULL)
    own = rpm[problem.groups.lead]
    same: list[int] = []
    for group in np.argsort(own, kind="stable").tolist():
        if same and own[group] - own[same[0]] > SAME_RPM:
            _round_speed(problem, same, speeds, worth)
            same = []
        same.append(group)
    if same:
        _round_speed(problem, same, speeds, worth)
    most = allowed.feed_max(speeds[None])[0]
    chosen = _within_power(problem, np.where(full, most, np.minimum(feed, most)), speeds)
    inch, words = [problem.program.lines[int(k)].inch for k in allowed.index], problem.program.words
    written = np.array(
        [words.figure_mm_min(words.feed_figure(float(f), i), i) for f, i in zip(chosen, inch, strict=True)], dtype=np.float64
    )
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


def _round_speed(problem: Problem, same: list[int], speeds: Floats, worth: Worth) -> None:
    """One speed for groups that have the same; each its own where no whole one suits all; to a hundredth where none suits one."""
    allowed, rows = problem.allowed, np.concatenate([problem.groups.rows[group] for group in same])
    middle = float(speeds[rows].mean())
    whole = [n for n in (np.floor(middle), np.ceil(middle)) if all(_fits(problem, group, n) for group in same)]
    if whole:
        at = np.array([[n] * len(allowed) for n in whole])
        value = worth.of(rows, allowed.feed_max(at)[:, rows] * allowed.feed_ratio, np.array(whole))
        speeds[rows] = whole[int(np.argmin(value))]
    elif len(same) > 1:
        for group in same:
            _round_speed(problem, [group], speeds, worth)
    else:
        near = [n for n in (np.floor(middle * 100) / 100, np.ceil(middle * 100) / 100) if _fits(problem, same[0], n)]
        speeds[rows] = near[0] if near else middle


def _fits(problem: Problem, group: int, rpm: float) -> bool:
    return any(a - 1e-9 <= rpm <= b + 1e-9 for a, b in problem.spans[group])
