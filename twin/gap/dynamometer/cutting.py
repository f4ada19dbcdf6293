"""Finds the stretches in which a recording of forces cuts evenly: one speed, feed and engagement, turn by turn of the spindle.

A turn is in the air where the force hardly changes within it, whatever the plan says. At the edge of the work, where the tool is
not in yet or comes out, the engagement is not the planned one: turns whose force is far from the stretch's own are left out, and
those within a tool's radius of feed after the air.
"""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.machine import Tool
from twin.runlog import AXIS_COLUMN, RunLog

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.intp]

FORCES = ("force_x_n", "force_y_n")
ENGAGEMENT = ("spindle_rpm", "axial_depth_mm", "entry_angle_rad", "exit_angle_rad")
TAU = 2.0 * np.pi
ALIKE = 0.03
"""Part by which speed, feed and depth may change within a stretch, and rad by which angles may."""
AIR_PART = 0.2
"""Part of the stretch's own change of force in a turn; with less, a turn is in the air."""
OWN = (0.6, 1.6)
"""Parts of that change; with less or more, a turn is at the edge of the work, or something happened."""
TURNS_MIN, TURNS_MAX = 8, 4000
"""Turns of a stretch below which it says nothing, and above which no more are needed."""


@dataclass(frozen=True, slots=True, eq=False)
class Turns:
    """The turns of the spindle in a recording, (turns,) each.

    of: (n,) number of the turn of each sample; level_n: rms of the force about its mean in the turn
    rpm, feed_mm_s, depth_mm, entry_rad, exit_rad: means over the turn; heading_rad: of the feed, NaN where nothing tells
    """

    of: Ints
    level_n: Floats
    rpm: Floats
    feed_mm_s: Floats
    depth_mm: Floats
    entry_rad: Floats
    exit_rad: Floats
    heading_rad: Floats

    def rows(self) -> Floats:
        """Return the figures that stay alike within a stretch, (5, turns)."""
        return np.stack([self.rpm, self.feed_mm_s, self.depth_mm, self.entry_rad, self.exit_rad])


@dataclass(frozen=True, slots=True, eq=False)
class Cutting:
    """The even stretches of a recording, each the numbers of its turns, and the turns that are in the air."""

    stretches: tuple[Ints, ...]
    air: Bools


def is_of_forces_alone(log: RunLog, axes: Collection[str]) -> bool:
    """Return True where forces are recorded, and nothing that one of these axes answers with.

    A position that is the reference over again is no answer.

    >>> from twin.runlog import run_log
    >>> row = np.ones(1)
    >>> is_of_forces_alone(run_log({"t_s": row, "force_x_n": row, "x_ref_mm": row, "x_pos_mm": row}), "x")
    True
    >>> is_of_forces_alone(run_log({"t_s": row, "force_x_n": row, "x_torque_a": row}), "x")
    False
    """
    return any(log.has(force) for force in FORCES) and not any(_is_answer(log, name, axes) for name in log.columns)


def _is_answer(log: RunLog, name: str, axes: Collection[str]) -> bool:
    match = AXIS_COLUMN.match(name)
    if match is None or match[2] == "ref_mm" or match[1] not in axes or not log.has(name):
        return False
    reference = f"{match[1]}_ref_mm"
    return match[2] == "torque_a" or not log.has(reference) or not np.array_equal(log[name], log[reference], equal_nan=True)


def missing(log: RunLog) -> list[str]:
    """Return what a recording of forces lacks to be compared."""
    lacks = [name for name in ENGAGEMENT if not log.has(name)]
    return lacks if log.has("feed_mm_min") or log.has("x_ref_mm", "y_ref_mm") else [*lacks, "feed_mm_min"]


def turns_of(log: RunLog, angle_rad: Floats) -> Turns:
    """The turns of the spindle, by its angle as far as it is known, (n,), increasing."""
    of = np.floor((angle_rad - angle_rad[0]) / TAU).astype(np.intp)
    rpm, depth, entry, leaving = (_held(log[name]) for name in ENGAGEMENT)
    if not _is_sparse(log["axial_depth_mm"]):
        depth = np.nan_to_num(log["axial_depth_mm"])  # null = not in the cut
    feed, heading = _feed(log)
    force = [_held(log[name]) for name in FORCES if log.has(name)]
    variance = np.sum([_mean(f**2, of) - _mean(f, of) ** 2 for f in force], axis=0)
    across, along = _mean(np.sin(heading), of), _mean(np.cos(heading), of)
    return Turns(
        of=of,
        level_n=np.sqrt(np.maximum(variance, 0.0)),
        rpm=_mean(rpm, of),
        feed_mm_s=_mean(feed, of),
        depth_mm=_mean(np.nan_to_num(depth), of),
        entry_rad=_mean(np.nan_to_num(entry), of),
        exit_rad=_mean(np.nan_to_num(leaving), of),
        heading_rad=np.arctan2(across, along),
    )


def cutting_of(turns: Turns, tool: Tool) -> Cutting:
    """The even stretches, and the turns in the air."""
    air = turns.depth_mm <= 0.0
    alike = _runs_alike(turns.rows(), ~air)
    stretches: list[Ints] = []
    for first, last in alike:
        level = turns.level_n[first:last]
        own = float(np.median(level[level >= AIR_PART * np.quantile(level, 0.9)]))
        outside = level < AIR_PART * own
        air[first:last] |= outside
        kept = (level > OWN[0] * own) & (level < OWN[1] * own)
        inside = kept & ~_entering(outside, turns, first, tool)
        chosen = np.flatnonzero(inside if inside.sum() >= max(TURNS_MIN, 0.3 * kept.sum()) else kept)
        if len(chosen) >= TURNS_MIN:
            stretches.append(first + chosen[:TURNS_MAX])
    return Cutting(tuple(stretches), air)


def _entering(outside: Bools, turns: Turns, first: int, tool: Tool) -> Bools:
    """Return True within a tool's radius of feed of the air, on either side: the work's edge is in the cut there."""
    feed = float(np.median(turns.feed_mm_s[first : first + len(outside)]))
    rpm = float(np.median(turns.rpm[first : first + len(outside)]))
    reach = int(np.ceil(0.5 * tool.diameter_mm / max(feed, 1e-9) * rpm / 60.0))
    if not outside.any():
        return np.zeros(len(outside), dtype=bool)
    near = np.convolve(outside, np.ones(2 * min(reach, len(outside)) + 1), mode="full")
    return np.asarray(near[min(reach, len(outside)) :][: len(outside)] > 0.5)


def _runs_alike(rows: Floats, wanted: Bools) -> list[tuple[int, int]]:
    """First and behind the last turn of each run of wanted turns in which no row changes by more than ALIKE."""
    allowed = ALIKE * np.array([1.0, 1.0, 1.0, 0.0, 0.0])[:, None] * np.abs(rows).max(axis=1, keepdims=True)
    allowed[3:] = ALIKE
    found, first = list[tuple[int, int]](), 0
    for turn in range(1, rows.shape[1] + 1):
        ends = turn == rows.shape[1] or not wanted[turn] or not wanted[first]
        if ends or bool((np.abs(rows[:, turn] - rows[:, first]) > allowed[:, 0]).any()):
            if wanted[first] and turn - first >= TURNS_MIN:
                found.append((first, turn))
            first = turn
    return found


def _feed(log: RunLog) -> tuple[Floats, Floats]:
    """Path feed, mm/s, and its heading, NaN where nothing tells it; (n,) each."""
    if log.has("x_ref_mm", "y_ref_mm"):
        step = [np.gradient(_held(log[f"{axis}_ref_mm"]), log.t_s) for axis in "xy"]
        return np.hypot(*step), np.arctan2(step[1], step[0])
    return _held(log["feed_mm_min"]) / 60.0, np.full(len(log), np.nan)


def _held(values: Floats) -> Floats:
    """A series whose missing samples hold the last one there was."""
    there = np.isfinite(values)
    if there.all():
        return values
    last = np.maximum.accumulate(np.where(there, np.arange(len(values)), -1))
    return np.asarray(values[np.where(last < 0, int(np.argmax(there)), last)])


def _is_sparse(values: Floats) -> bool:
    """Return True where a series is recorded more slowly than the others, so that what is missing is not absent."""
    there = np.flatnonzero(np.isfinite(values))
    return len(there) > 1 and float(np.median(np.diff(there))) > 1.0


def _mean(values: Floats, of: Ints) -> Floats:
    """Mean over each turn, (turns,)."""
    return np.asarray(np.bincount(of, weights=values) / np.maximum(np.bincount(of), 1))
