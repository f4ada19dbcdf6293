"""Scores of a cell that know no parts, in frames of 10 s.

plain            isolation forest on the five signals as they are; gate only
gate             isolation forest on the signals beside what is usual in the operation; gate only
source f         the published ratio rule on that score, with factor f; "sound": peers in a tool change left out
residual         score minus centre of the peers' (in spreads)
own features     smoothed features, no peers (a MEWMA chart)
features         smoothed features, what peers share subtracted feature by feature (twin/anomaly/common_features.py)
random, constant, vibration: what a detector has to beat
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.evaluation.baselines import constant_score, one_feature_score, random_score
from benchmarks.scored.detectors import SCORES
from benchmarks.scored.judged import FRAME_S, Judged, alarms_of, outcome, threshold_of
from benchmarks.simulated_cell.cell import Cell, machine_readings
from benchmarks.simulated_cell.schedule import DAY_S, Schedule
from benchmarks.simulated_cell.signals import FEATURES
from twin.anomaly.common_features import left_over_rows, with_tails
from twin.anomaly.common_mode import CommonModeRule, Method, adjust_frames
from twin.anomaly.detector import Detector, trained_model
from twin.anomaly.gate import gate
from twin.anomaly.preparation import (
    STANDING,
    TURNS_RPM_MIN,
    Preparation,
    fit_preparation,
    smoothed_rows,
    standardised_rows,
)

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
TICK_S = 1.0
TAIL_S, LATE_LOOK_BACK_S = 8.0, 26.0
FOREST = Detector(parameters={"n_estimators": 100})


@dataclass(frozen=True)
class Frames:
    """A cell at each frame. (T, N), or (T, N, F).

    plain, usual: forest's score of the signals as they are, and beside what is usual; beside: those signals
    smooth, last: smoothed features, and when each was last told of
    shut: gated; judged: not gated, the spindle turns in a regime that was learned; train, calibrate, judge: frames of the weeks
    """

    cell: Cell
    plain: Floats
    usual: Floats
    vibration: Floats
    beside: Floats
    smooth: Floats
    last: NDArray[np.int64]
    shut: Flags
    judged: Flags
    ticks: NDArray[np.int64]
    preparations: tuple[Preparation, ...]
    train: slice
    calibrate: slice
    judge: slice


def framed(cell: Cell, days: tuple[int, int, int]) -> Frames:
    """Learn on the first days, and bring all of them to frames."""
    ends = np.cumsum(days) * DAY_S // FRAME_S
    train, calibrate, judge = (slice(start, end) for start, end in zip([0, *ends[:-1]], ends, strict=True))
    machines = [_machine(cell, place, days[0] * DAY_S) for place in range(len(cell.machines))]
    columns = (np.stack(column, axis=1) for column in zip(*(arrays for arrays, _ in machines), strict=True))
    plain, usual, vibration, beside, smooth, last, shut, judged = columns
    ticks = np.arange(len(plain), dtype=np.int64) * FRAME_S + FRAME_S - 1
    preparations = tuple(preparation for _, preparation in machines)
    return Frames(cell, plain, usual, vibration, beside, smooth, last, shut, judged, ticks, preparations, train, calibrate, judge)


def _machine(cell: Cell, place: int, train_s: int) -> tuple[list[NDArray[Any]], Preparation]:
    """The arrays of `Frames` from `plain` to `judged` for one machine, in this order; what is usual for it."""
    rows, schedule = machine_readings(cell, place).rows, cell.schedules[place]
    look_back_s = LATE_LOOK_BACK_S if cell.machines[place].label_late_s else 0.0
    shut = gate(schedule.tool_change_active, TICK_S, TAIL_S, look_back_s)
    codes, names = regimes(schedule, rows)
    learn = ~shut[:train_s]
    usual = fit_preparation(rows[:train_s][learn], codes[:train_s][learn], names, FEATURES, TICK_S)
    values, tells, judged = standardised_rows(usual, rows, codes, names)
    smooth, last = smoothed_rows(usual, values, tells & ~shut[:, None], TICK_S)
    at = slice(FRAME_S - 1, None, FRAME_S)
    learned = slice(0, train_s // FRAME_S)
    plain, beside = rows[at], values[at]
    scores = [
        trained_model(FOREST, part[learned][mask[at][learned]], FEATURES).scores(part)
        for part, mask in ((plain, ~shut), (beside, ~shut & judged))
    ]
    vibration = one_feature_score(plain[:, 4], plain[learned, 4])
    return [*scores, vibration, beside, smooth[at], last[at], shut[at], (judged & ~shut)[at]], usual


def regimes(schedule: Schedule, rows: Floats) -> tuple[NDArray[np.int64], list[str]]:
    """Code of the regime at each tick, and the names of the codes."""
    override = np.round(schedule.feed_override_pct / 10.0).astype(np.int64) * 10
    keys = (schedule.program.astype(np.int64) * 1000 + schedule.tool_number) * 1000 + override
    keys = np.where(rows[:, FEATURES.index("spindle_rpm")] < TURNS_RPM_MIN, -1, keys)
    known, codes = np.unique(keys, return_inverse=True)
    names = [STANDING if key < 0 else f"{key // 1_000_000}|{key // 1000 % 1000}|{key % 1000}" for key in known]
    return codes, names


def adjusted(frames: Frames, method: str) -> tuple[Floats, Flags]:
    """Adjusted scores and where they are gated or not judged, (T, N)."""
    idle = ~frames.judged
    rules = {
        "source .5": CommonModeRule(factor=0.5),
        "source .8": CommonModeRule(factor=0.8),
        "source .5 sound": CommonModeRule(factor=0.5, exclude_gated_peers=True),
        "source .8 sound": CommonModeRule(factor=0.8, exclude_gated_peers=True),
    }
    if method in rules:
        return adjust_frames(rules[method], frames.usual, idle)[0], idle
    if method == "residual":
        return adjust_frames(CommonModeRule(Method.RESIDUAL), _standardised(frames), idle)[0], idle
    if method in ("features", "own features"):
        return _lengths(frames, method == "features"), idle
    if method in SCORES:
        every = range(frames.usual.shape[1])
        found = [SCORES[method](frames.beside[:, place], idle[:, place], frames.train) for place in every]
        return np.stack(found, axis=1), idle
    shape, rng = frames.usual.shape, np.random.default_rng(frames.cell.seed)
    others: dict[str, Callable[[], tuple[Floats, Flags]]] = {
        "plain": lambda: (frames.plain, frames.shut),
        "gate": lambda: (frames.usual, idle),
        "random": lambda: (random_score(shape[0] * shape[1], rng).reshape(shape), idle),
        "constant": lambda: (constant_score(shape[0] * shape[1]).reshape(shape), idle),
        "vibration": lambda: (frames.vibration, frames.shut),
    }
    return others[method]()


METHODS = (
    *("plain", "gate", "source .5", "source .8", "source .5 sound", "source .8 sound", "residual", "own features", "features"),
    *SCORES,
    *("random", "constant", "vibration"),
)


def _standardised(frames: Frames) -> Floats:
    """z of the raw score, by its median and robust deviation in the weeks without faults."""
    z = np.empty(frames.usual.shape)
    before = slice(0, frames.calibrate.stop)
    for place in range(z.shape[1]):
        low, middle, high = np.percentile(frames.usual[before, place][frames.judged[before, place]], [25, 50, 75])
        z[:, place] = (frames.usual[:, place] - middle) / ((high - low) / 1.349)
    return z


def _row_lengths(preparation: Preparation, left: Floats) -> Floats:
    """Return `twin.anomaly.common_features.length` of rows (T, F)."""
    shares = left / np.where(left > 0.0, np.array(preparation.up), np.array(preparation.down))
    return np.asarray(np.sqrt((shares**2).sum(axis=1)), dtype=np.float64)


def _lengths(frames: Frames, has_peers: bool) -> Floats:
    left = left_over_rows(frames.smooth, frames.last, frames.ticks, TICK_S) if has_peers else frames.smooth
    found = np.empty(frames.usual.shape)
    for place, usual in enumerate(frames.preparations):
        learned = left[frames.train, place][frames.judged[frames.train, place]]
        found[:, place] = _row_lengths(with_tails(usual, learned), left[:, place])
    return found


def judged(frames: Frames, method: str, alerts_per_week: float = 1.0) -> list[Judged]:
    """Each machine by itself: its threshold, what it finds, and what it should not have said."""
    scores, shut = adjusted(frames, method)
    results = []
    for place in range(scores.shape[1]):
        before, own = (scores[part, place] for part in (frames.calibrate, frames.judge))
        idle = shut[frames.judge, place]
        threshold = threshold_of(before, shut[frames.calibrate, place], FRAME_S, alerts_per_week)
        on = alarms_of(threshold, own, idle, FRAME_S)
        from_s = frames.judge.start * FRAME_S
        has_threshold = threshold is not None
        results.append(outcome(frames.cell, place, from_s, FRAME_S, scores=own, idle=idle, on=on, has_threshold=has_threshold))
    return results
