"""Recordings of a cell as parts: ticks of all machines on one grid, and the scores of `twin/anomaly/parts/` over them.

The functions that judge are those of the stream (`twin/anomaly/parts/replay.py`), so a replay is the day again. Stretches that
were recorded apart are put `APART_S` after each other: a machine is known, its ticks in between are not.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cnctwin.training.anomaly.held_rows import held_rows, held_text
from cnctwin.training.anomaly.recorded_cell import TOOL_CHANGE, Stretch
from cnctwin.training.anomaly.track import Track
from processors.joint_anomaly.expectations import Expectations, expected_at
from processors.joint_anomaly.moment import FEED_OVERRIDE, PROGRAM, SPINDLE_OVERRIDE, TOOL
from twin.anomaly.alarm import AlarmRule
from twin.anomaly.gate import gate
from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.replay import EXPECTED, Recorded, replayed
from twin.runlog import RunLog

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Whole = NDArray[np.int64]
LINE = "line"
TELLS = (PROGRAM, TOOL, LINE)
APART_S = 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PartTicks:
    """The way recordings become ticks of parts. All in s, but tick and gap; expectations: of the twin, by machine."""

    signals: tuple[str, ...]
    tick_ms: int
    gap_ms: int
    tail_s: float
    look_back_s: float
    expectations: Mapping[str, Expectations] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class _Ticks:
    """A run at the ticks that its messages bring; at: (T,), their numbers."""

    at: Whole
    values: Floats
    words: tuple[str, ...]
    columns: Mapping[str, NDArray[np.generic]]
    gated: Flags


def cell_of_parts(machines: Sequence[str], stretches: Sequence[Stretch], ticks: PartTicks) -> tuple[Recorded, ...]:
    """Return the recordings of these machines over all stretches, on one grid of ticks."""
    runs: dict[str, list[tuple[int, _Ticks]]] = {machine: [] for machine in machines}
    zero, begins, apart = 0, 0, round(1000.0 * APART_S / ticks.tick_ms)
    for stretch in stretches:
        held = {machine: _ticks(run, ticks) for machine, run in stretch.items()}
        told = [one for one in held.values() if len(one.at)]
        if not told:
            continue
        first, last = min(int(one.at[0]) for one in told), max(int(one.at[-1]) for one in told)
        zero = zero if begins else first
        for machine, one in held.items():
            runs[machine].append((begins - first, one))
        begins += last - first + 1 + apart
    return tuple(_recorded(machine, runs[machine], (zero, max(begins - apart, 0)), ticks) for machine in machines)


def _ticks(run: RunLog, ticks: PartTicks) -> _Ticks:
    numbers = (TOOL, LINE, FEED_OVERRIDE, SPINDLE_OVERRIDE, TOOL_CHANGE)
    at_ms, rows = held_rows(run, (*ticks.signals, *numbers), ticks.tick_ms, ticks.gap_ms)
    width = len(ticks.signals)
    words, program = held_text(run, PROGRAM, at_ms)
    columns: dict[str, NDArray[np.generic]] = {name: rows[:, width + place] for place, name in enumerate(numbers)}
    columns[PROGRAM] = np.where(program == len(words) - 1, -1, program)
    shut = gate(rows[:, width + numbers.index(TOOL_CHANGE)], ticks.tick_ms / 1000.0, ticks.tail_s, ticks.look_back_s)
    names = tuple(word for word in words if word is not None)
    return _Ticks(at_ms // ticks.tick_ms, rows[:, :width], names, columns, shut)


def _recorded(machine: str, runs: Sequence[tuple[int, _Ticks]], grid: tuple[int, int], ticks: PartTicks) -> Recorded:
    """Return one machine on a grid of so many ticks from the first on; what it did not tell is not known."""
    first, count = grid
    programs = tuple(dict.fromkeys(name for _, one in runs for name in one.words))
    values = np.full((count, len(ticks.signals)), np.nan)
    program, tool, line = (np.full(count, -1, dtype=np.int64) for _ in range(3))
    feed_pct, spindle_pct = np.full(count, np.nan), np.full(count, np.nan)
    gated, is_known = np.zeros(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    for offset, one in runs:
        at = one.at + offset
        values[at], gated[at], is_known[at] = one.values, one.gated, True
        places = np.array([*(programs.index(name) for name in one.words), -1], dtype=np.int64)
        program[at] = places[np.asarray(one.columns[PROGRAM], dtype=np.int64)]
        tool[at], line[at] = _whole(one.columns[TOOL]), _whole(one.columns[LINE])
        feed_pct[at], spindle_pct[at] = one.columns[FEED_OVERRIDE], one.columns[SPINDLE_OVERRIDE]
    own = ticks.expectations.get(machine, {})
    return Recorded(
        machine=machine,
        tick_s=ticks.tick_ms / 1000.0,
        signals=ticks.signals,
        values=values,
        programs=programs,
        program=program,
        tool=tool,
        line=line,
        feed_override_pct=feed_pct,
        spindle_override_pct=spindle_pct,
        gated=gated,
        expected=_expected(own, programs, np.column_stack([program, line, tool])) if own else None,
        is_known=is_known,
        first_tick=first,
    )


def _whole(column: NDArray[np.generic]) -> Whole:
    return np.nan_to_num(np.asarray(column, dtype=np.float64), nan=-1.0).astype(np.int64)


def _expected(own: Expectations, programs: Sequence[str], at: Whole) -> Floats:
    """Return (T, 6) of what the twin expects at each tick, NaN where nothing; at: (T, 3) program, line, tool."""
    places, which = np.unique(at, axis=0, return_inverse=True)
    rows = np.full((len(places), len(EXPECTED)), np.nan)
    for row, (program, line, tool) in zip(rows, places.tolist(), strict=True):
        name = programs[program] if program >= 0 else None
        found = expected_at(own, name, line if line >= 0 else None, tool if tool >= 0 else None)
        if found is not None:
            row[:] = [getattr(found, name) for name in EXPECTED]
    return np.asarray(rows[which.ravel()])


def tracks_of_parts(
    cell: Sequence[Recorded], models: Sequence[PartsModel], rules: Sequence[AlarmRule | None] | None
) -> tuple[Track, ...]:
    """Return the scores of each machine at the ticks that it told of."""
    found = replayed(models, cell, rules)
    tracks = []
    for place, one in enumerate(cell):
        known = np.ones(len(one.values), dtype=np.bool_) if one.is_known is None else one.is_known
        at = np.flatnonzero(known)
        shut = one.gated[at]
        adjusted = found.scores[at, place]
        tracks.append(
            Track(
                np.asarray((one.first_tick + at) * one.tick_s, dtype=np.float64),
                found.own_scores[at, place],
                np.where(shut & np.isfinite(adjusted), 0.0, adjusted),
                shut,
                shut | found.is_idle[at, place],
            )
        )
    return tuple(tracks)


def missing_of_parts(stretches: Sequence[Stretch], machine: str) -> tuple[str, ...]:
    """Return what tells of the place in the part, and is in no recording of a machine."""
    runs = [stretch[machine] for stretch in stretches if machine in stretch]
    told = [name for name in TELLS if any(name in run.text or run.has(name) for run in runs)]
    return tuple(name for name in TELLS if name not in told)
