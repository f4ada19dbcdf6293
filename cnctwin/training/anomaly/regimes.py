"""The operation of a machine at each tick, by the signals that name it, and its features beside what is usual in that."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cnctwin.training.anomaly.held_rows import held_rows, held_text
from cnctwin.training.anomaly.recorded_cell import TOOL_CHANGE, Stretch
from twin.anomaly.common_features import left_over_rows, with_tails
from twin.anomaly.gate import gate
from twin.anomaly.preparation import (
    CONTEXT,
    NEVER,
    SPEED,
    TURNS_RPM_MIN,
    Preparation,
    Regime,
    fit_preparation,
    regime_name,
    smoothed_rows,
    standardised_rows,
)
from twin.runlog import RunLog

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ticks:
    """The way a recording becomes ticks, and which of them are gated. All in s, but tick and gap."""

    features: tuple[str, ...]
    tick_ms: int
    gap_ms: int
    tail_s: float
    look_back_s: float

    @property
    def tick_s(self) -> float:
        """Between two ticks."""
        return self.tick_ms / 1000.0


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """One run by ticks. at_ms: (T,); rows: (T, F), NaN = not known; gated: (T,); codes: (T,) into names, of regimes"""

    at_ms: NDArray[np.int64]
    rows: Floats
    gated: Flags
    codes: NDArray[np.int64]
    names: tuple[str, ...]

    @property
    def quiet(self) -> Flags:
        """(T,) wholly known and not gated."""
        return np.asarray(~self.gated & np.isfinite(self.rows).all(axis=1))


def held_run(run: RunLog, ticks: Ticks) -> Held:
    """A run by ticks."""
    numbers = [name for name in CONTEXT if name != "program"]
    at_ms, values = held_rows(run, (*ticks.features, TOOL_CHANGE, *numbers), ticks.tick_ms, ticks.gap_ms)
    width = len(ticks.features)
    rows, active, told = values[:, :width], values[:, width], values[:, width + 1 :]
    words, program = held_text(run, "program", at_ms)
    columns = np.column_stack([program, np.nan_to_num(told, nan=-np.inf), _stands(rows, ticks.features)])
    _, first, codes = np.unique(columns, axis=0, return_index=True, return_inverse=True)
    ones = Regime(center=(0.0,) * width, spread=(1.0,) * width)
    plain = Preparation(signals=ticks.features, overall=ones, regimes={}, up=(1.0,) * width, down=(1.0,) * width)
    found = []
    for place in first.tolist():
        known = dict(zip(numbers, (None if np.isnan(x) else float(x) for x in told[place]), strict=True))
        context = [words[program[place]] if name == "program" else known[name] for name in CONTEXT]
        found.append(regime_name(plain, np.nan_to_num(rows[place], nan=np.inf).tolist(), context))
    names = tuple(dict.fromkeys(found))
    codes = np.array([names.index(name) for name in found])[codes.ravel()] if found else codes
    return Held(at_ms, rows, gate(active, ticks.tick_s, ticks.tail_s, ticks.look_back_s), codes.astype(np.int64), names)


def _stands(rows: Floats, features: Sequence[str]) -> Floats:
    if SPEED not in features:
        return np.zeros(len(rows))
    return np.asarray(rows[:, features.index(SPEED)] < TURNS_RPM_MIN, dtype=np.float64)


def standardised(preparation: Preparation, held: Held) -> tuple[Floats, Flags]:
    """y (T, F) of a run, and (T,) whether it is judged: known, not gated, the spindle turning in a regime that has a baseline."""
    values, _, judged = standardised_rows(preparation, held.rows, held.codes, held.names)
    return values, np.asarray(judged & held.quiet)


def fitted_preparation(held: Sequence[Held], ticks: Ticks) -> Preparation:
    """The baselines of one machine, from its runs; tails are fitted later. Raises ValueError where its spindle never turns."""
    names = tuple(dict.fromkeys(name for one in held for name in one.names))
    codes = [np.array([names.index(name) for name in one.names])[one.codes][one.quiet] for one in held]
    rows = np.concatenate([one.rows[one.quiet] for one in held])
    return fit_preparation(rows, np.concatenate(codes), names, ticks.features, ticks.tick_s)


def tailed_preparations(
    preparations: Mapping[str, Preparation], stretches: Sequence[Stretch], ticks: Ticks
) -> dict[str, Preparation]:
    """The preparations of all machines of a cell with the tails of what their peers leave."""
    left: dict[str, list[Floats]] = {machine: [] for machine in preparations}
    for stretch in stretches:
        held = {machine: held_run(run, ticks) for machine, run in stretch.items()}
        for machine, rows in left_in(preparations, held, ticks).items():
            left[machine].append(rows)
    return {machine: with_tails(preparations[machine], np.concatenate(rows)) for machine, rows in left.items()}


def left_in(preparations: Mapping[str, Preparation], held: Mapping[str, Held], ticks: Ticks) -> dict[str, Floats]:
    """Return what is left of each machine's features beside the others', at its judged ticks (T, F)."""
    first = min(int(one.at_ms[0]) for one in held.values() if len(one.at_ms))
    last = max(int(one.at_ms[-1]) for one in held.values() if len(one.at_ms))
    count, width = (last - first) // ticks.tick_ms + 1, len(ticks.features)
    smooth, told = np.zeros((count, len(held), width)), np.full((count, len(held), width), NEVER, dtype=np.int64)
    judged = np.zeros((count, len(held)), dtype=np.bool_)
    for place, (machine, one) in enumerate(held.items()):
        at = (one.at_ms - first) // ticks.tick_ms
        values, tells, is_judged = standardised_rows(preparations[machine], one.rows, one.codes, one.names)
        on_grid, tells_on_grid = np.zeros((count, width)), np.zeros((count, width), dtype=np.bool_)
        on_grid[at], tells_on_grid[at] = np.nan_to_num(values), tells & one.quiet[:, None]
        smooth[:, place], told[:, place] = smoothed_rows(preparations[machine], on_grid, tells_on_grid, ticks.tick_s)
        judged[at, place] = is_judged & one.quiet
    left = left_over_rows(smooth, told, np.arange(count), ticks.tick_s)
    return {machine: left[judged[:, place], place] for place, machine in enumerate(held)}
