"""A cut that a dynamometer recorded, as the mean turns of its even stretches: a short recording in place of a long one.

Its log has a turn of the spindle for each block of turns, and beside the columns of any log

    stretch: number of the even stretch; heading_rad: of the feed, NaN where nothing tells it
    force_x_n_spread, force_y_n_spread: floor of the turn, N
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.case import Run, RunAtHand
from twin.gap.dynamometer.cutting import FORCES, TAU, Cutting, Turns, cutting_of, is_of_forces_alone, missing, turns_of
from twin.gap.dynamometer.heading import WORDS, square_heading
from twin.gap.dynamometer.mean_turn import Engagement, orders_of
from twin.gap.dynamometer.spindle_phase import followed, stated_angle
from twin.gap.dynamometer.turn_floor import turn_floor
from twin.gap.dynamometer.turn_mean import TurnMeans, highest_order, turn_means
from twin.machine import MachineFile, Tool
from twin.runlog import RunLog

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
AIR_TURNS = 3
"""Turns in the air that tell what a sensor shows of no force."""
SLOW_DRIFT = 3.0
"""Floors by which an offset may move before it is mentioned."""
SPREAD = "_spread"


@dataclass(frozen=True)
class TurnRun(RunAtHand):
    """A run whose log holds mean turns.

    points: of a turn; highest: order up to which turns are known; knows_phase: whether the spindle's angle was recorded, and fits
    knows_mean: whether the mean force is known, by what the sensors show in the air
    """

    points: int
    highest: int
    knows_phase: bool
    knows_mean: bool


def turn_run(run: Run, log: RunLog, machine: MachineFile, notes: list[str]) -> Run | None:
    """The run as mean turns; None where it is not of forces alone, or lacks what a cut is compared by, which `notes` say."""
    if not is_of_forces_alone(log, machine.axes):
        return None
    lacks = ([] if machine.tool else ["[tool] in the machine's file"]) + missing(log)
    if lacks or machine.tool is None:
        notes.append(f"{run.name}: the forces are not compared without {', '.join(lacks)}")
        return None
    has_angle = log.has("spindle_angle_rad")
    rpm = log["spindle_rpm"][np.isfinite(log["spindle_rpm"])]
    if not (rpm > 0.0).any() or len(log) < 2:
        notes.append(f"{run.name}: spindle_rpm is never above 0, so nothing is cut")
        return None
    angle = stated_angle(log.t_s, _filled(log["spindle_rpm"]), log["spindle_angle_rad"] if has_angle else None)
    turns = turns_of(log, angle)
    cutting = cutting_of(turns, machine.tool)
    samples = len(log) / (int(turns.of[-1]) + 1)
    if not cutting.stretches:
        notes.append(f"{run.name}: nowhere is anything cut evenly for some turns; its forces are not compared")
        return None
    if highest_order(machine.tool.teeth, samples) < machine.tool.teeth:
        notes.append(f"{run.name}: {samples:.3g} samples a turn do not carry the passing of {machine.tool.teeth} teeth")
        return None
    return _as_turns(run, log, turns, cutting, (machine, machine.tool, angle, has_angle), notes)


def _as_turns(
    run: Run, log: RunLog, turns: Turns, cutting: Cutting, spindle: tuple[MachineFile, Tool, Floats, bool], notes: list[str]
) -> TurnRun:
    machine, tool, angle, has_angle = spindle
    signals = tuple(name for name in FORCES if log.has(name))
    force = np.stack([_filled(log[name]) for name in signals])
    offset = _offset(force, turns.of, cutting.air)
    force = force - (force.mean(axis=1, keepdims=True) if offset is None else offset)
    samples = [np.flatnonzero(np.isin(turns.of, stretch)) for stretch in cutting.stretches]
    found = [
        followed(force[:, s] - force[:, s].mean(axis=1, keepdims=True), angle[s], tool.teeth, recorded=has_angle) for s in samples
    ]
    fits = has_angle and all(not _was_replaced(f.angle_rad, angle[s]) for f, s in zip(found, samples, strict=True))
    means = [
        turn_means(force[:, s], f.angle_rad, turns.of[s], tool.teeth, with_mean=offset is not None)
        for f, s in zip(found, samples, strict=True)
    ]
    cuts = [_engagement(turns, s, f.off) for s, f in zip(samples, found, strict=True)]
    if any(np.isnan(cut.heading_rad) for cut in cuts):
        known = [(cut, m.force.mean(axis=1)) for cut, m in zip(cuts, means, strict=True)]
        heading = square_heading(machine, known, [FORCES.index(name) for name in signals])
        cuts = [replace(cut, heading_rad=heading) for cut in cuts]
        notes.append(f"{run.name}: no reference tells the direction of the feed; it is taken to go {WORDS[heading]}")
    parts = [
        _stretch(number, log.t_s[s[m.at]], cut, m, signals)
        for number, (s, cut, m) in enumerate(zip(samples, cuts, means, strict=True))
    ]
    if log.has("tool_number"):
        number = float(log["tool_number"][np.isfinite(log["tool_number"])][0])
        parts = [part | {"tool_number": np.full(len(part["t_s"]), number)} for part in parts]
    notes += _said(run, log, signals, cutting, [f.off for f in found], has_angle and not fits, offset)
    points, highest = means[0].force.shape[2], min(mean.highest for mean in means)
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    t_s = columns.pop("t_s")
    return TurnRun(
        run.entry, run.folder, RunLog(t_s, columns, {}, log.ignored, log.source), points, highest, fits, offset is not None
    )


def _was_replaced(angle_rad: Floats, stated_rad: Floats) -> bool:
    return bool(np.ptp(angle_rad - stated_rad) > 1e-9)


def _engagement(turns: Turns, samples: Ints, off: float) -> Engagement:
    """The conditions of a stretch, by its samples; off: part by which its speed is."""
    own = np.unique(turns.of[samples])
    rpm, feed, depth, entry, leaving = (float(np.median(row[own])) for row in turns.rows())
    return Engagement(rpm * (1.0 + off), feed, depth, entry, leaving, float(np.median(turns.heading_rad[own])))


def _stretch(number: int, at_s: Floats, cut: Engagement, means: TurnMeans, signals: tuple[str, ...]) -> dict[str, Floats]:
    """The columns of one stretch; at_s: (blocks,) when each block was in its middle, where it takes a turn."""
    blocks, points = means.force.shape[1:]
    within = np.arange(points) / points
    room_s = float(np.diff(at_s).min()) if len(at_s) > 1 else np.inf
    told = {
        "spindle_rpm": cut.rpm,
        "feed_mm_min": 60.0 * cut.feed_mm_s,
        "axial_depth_mm": cut.depth_mm,
        "entry_angle_rad": cut.entry_rad,
        "exit_angle_rad": cut.exit_rad,
        "heading_rad": cut.heading_rad,
        "stretch": float(number),
    }
    columns = {"t_s": (at_s[:, None] + within * min(60.0 / cut.rpm, room_s)).ravel()}
    columns |= {"spindle_angle_rad": np.tile(within * TAU, blocks)}
    columns |= {name: np.full(blocks * points, value) for name, value in told.items()}
    floor = turn_floor(orders_of(means.force, means.highest), cut.rpm / 60.0).rms()
    for name, mean, spread in zip(signals, means.force, floor, strict=True):
        columns |= {name: mean.ravel(), name + SPREAD: np.full(blocks * points, spread)}
    return columns


def _offset(force: Floats, turn: Ints, air: NDArray[np.bool_]) -> Floats | None:
    """The offset of the sensors, (signals, n): by lines from one stay in the air to the next; None where there is none."""
    inner = air & np.roll(air, 1) & np.roll(air, -1)
    groups = np.split(np.flatnonzero(inner), np.flatnonzero(np.diff(np.flatnonzero(inner)) > 1) + 1)
    groups = [group for group in groups if len(group) >= AIR_TURNS]
    if not groups:
        return None
    at, level = [], []
    for group in groups:
        for half in (group[: (len(group) + 1) // 2], group[len(group) // 2 :]):
            here = np.flatnonzero((turn >= half[0]) & (turn <= half[-1]))
            at.append(float(here.mean()))
            level.append(np.median(force[:, here], axis=1))
    return np.stack([np.interp(np.arange(force.shape[1]), at, row) for row in np.array(level).T])


def _said(
    run: Run,
    log: RunLog,
    signals: tuple[str, ...],
    cutting: Cutting,
    off: list[float],
    angle_runs_away: bool,
    offset: Floats | None,
) -> list[str]:
    """Notes on what was assumed and taken out."""
    turns = sum(len(stretch) for stretch in cutting.stretches)
    said = [
        f"{run.name}: compared by the mean turns of {len(off)} even stretches, {turns} turns; the floor is what they differ by"
    ]
    if angle_runs_away:
        said.append(f"{run.name}: spindle_angle_rad runs away from the forces; the phase of the spindle is taken from them")
    elif not log.has("spindle_angle_rad"):
        furthest = 100.0 * max(off, key=abs)
        said.append(
            f"{run.name}: spindle_angle_rad is not recorded; speed ({furthest:+.2g} % off what is stated) and phase are taken "
            "from the forces"
        )
    if offset is None:
        said.append(f"{run.name}: nowhere is the tool in the air, so the mean force is not known, and is not compared")
    else:
        for name, row in zip(signals, offset, strict=True):
            drift = float(np.ptp(row))
            if drift > 0.01 * float(np.nanstd(log[name])) * SLOW_DRIFT:
                said.append(f"{run.name}: {name} drifts by {drift:.3g} N in the air; a line between is taken out")
    return said


def _filled(values: Floats) -> Floats:
    """(n,) with what is missing taken from its neighbours."""
    there = np.flatnonzero(np.isfinite(values))
    return np.interp(np.arange(len(values)), there, values[there])
