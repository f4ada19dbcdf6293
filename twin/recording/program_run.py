"""Runs of part programs in a recording of the NIST Smart Manufacturing Systems Test Bed (Hurco machines).

What the keys mean was settled on the recordings themselves. `Block_Number` counts lines from 1, so that `line` = Block_Number −
1 is the index of the source line that is being executed. `Feed_Rate` is the path speed in mm/s, whatever unit the program has:
F120 in inches reads 50.8. `Program_Runtime_Seconds` counts only while the program advances: where it stands, an operator paused
the run (optional stop, feed hold, stop), whatever Program_Status says. Single values of it are wrong and are passed over.
Overrides are told only when a knob turns, so that a recording begins with what the one before ended with.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from twin.errors import RunLogError
from twin.recording.observations import Observation, Observations, last_values

Floats = NDArray[np.float64]
RUNNING = {"ACTIVE", "FEED_HOLD"}
PASSING = ("Program_Name_Running", "Block_Number")
"""Signals whose last value in one run says nothing of the next."""
STANDS_S = 2.5
"""A counter of seconds that has not moved for so long stands."""
OVERRIDES = {
    "Feed_Override": "feed_override_pct",
    "Rapid_Override": "rapid_override_pct",
    "Spindle_Override": "spindle_override_pct",
}


class Ending(StrEnum):
    """The end of a run."""

    COMPLETED = "completed"
    ABORTED = "aborted"


@dataclass(frozen=True, slots=True)
class Pause:
    """Time in which the program did not advance, s from the start of the run."""

    start_s: float
    end_s: float
    reason: str

    @property
    def duration_s(self) -> float:
        """Its length."""
        return self.end_s - self.start_s


@dataclass(frozen=True, slots=True)
class ProgramRun:
    """One execution of a program.

    program: the name that was running, where it was told; started_s: UTC seconds since 1970
    t_s: (n,) times of observations from the start; columns: an array (n,) for each signal of `COLUMNS`
    duration_s: from start to end, pauses and all
    """

    program: str | None
    started_s: float
    duration_s: float
    ending: Ending
    pauses: tuple[Pause, ...]
    columns: Mapping[str, NDArray[np.generic]]

    @property
    def t_s(self) -> Floats:
        """Times of the rows, s from the start."""
        return np.asarray(self.columns["t_s"], dtype=np.float64)

    @property
    def active_s(self) -> float:
        """Duration without the pauses."""
        return self.duration_s - sum(pause.duration_s for pause in self.pauses)

    def active(self, t_s: Floats) -> Floats:
        """Active seconds that have passed at the times `t_s` of the run."""
        at = np.asarray(t_s, dtype=np.float64)
        paused = sum((np.clip(at - pause.start_s, 0.0, pause.duration_s) for pause in self.pauses), np.zeros_like(at))
        return np.asarray(at - paused)

    def line_changes(self) -> tuple[Floats, NDArray[np.int64]]:
        """Active seconds (k,) at which a line was first told, and that line (k,), as long as lines ascend: one pass."""
        line = np.asarray(self.columns["line"], dtype=np.int64)
        new = np.flatnonzero((line > np.maximum.accumulate(np.concatenate([[-1], line[:-1]]))) & (line >= 0))
        return self.active(self.t_s[new]), line[new]


def program_runs(recording: Observations, before: Mapping[str, str] | None = None) -> list[ProgramRun]:
    """The runs in `recording`, in order. `before`: the last values of the recording before this one (`last_values`).

    Raises RunLogError where no program ever becomes ACTIVE.
    """
    rows = recording.rows
    starts = _starts(rows)
    if not starts:
        raise RunLogError(
            "no Program_Status|ACTIVE in this recording: no program ran, or it is an adapter's log (give its --devices)"
        )
    runs, over = [], 0
    for n, first in enumerate(starts):
        after = starts[n + 1] if n + 1 < len(starts) else len(rows)
        ended = next((k for k in range(first, after) if rows[k][1:] == ("Program_Status", "PROGRAM_COMPLETED")), None)
        end = after if ended is None else ended + 1
        state = {**(before or {}), **last_values(rows[:over])}
        for key in PASSING:
            state.pop(key, None)
        runs.append(_run(rows, first, end, state | last_values(rows[over:first]), ended is not None))
        over = end
    return runs


def _starts(rows: Sequence[Observation]) -> list[int]:
    """Return the start of each run: at ACTIVE after the end of another, or after a stop if the runtime counter starts again."""
    starts: list[int] = []
    status, runtime = None, 0.0
    for k, row in enumerate(rows):
        if row.key == "Program_Runtime_Seconds":
            runtime = float(row.value)
        if row.key != "Program_Status":
            continue
        if row.value == "ACTIVE" and status not in RUNNING:
            coming = [float(r.value) for r in rows[k : k + 60] if r.key == "Program_Runtime_Seconds"][:4]
            if status in {None, "PROGRAM_COMPLETED"} or (coming and min(coming) < runtime):
                starts.append(k)
        status = row.value
    return starts


def _run(rows: Sequence[Observation], first: int, end: int, before: Mapping[str, str], completed: bool) -> ProgramRun:
    state = dict(before)
    begin = rows[first].t_s
    names = [row.value for row in rows[first:end] if row.key == "Program_Name_Running"]
    table: dict[str, list[float | str | bool]] = {name: [] for name in COLUMNS}
    for k in range(first, end):
        state[rows[k].key] = rows[k].value
        if k + 1 == end or rows[k + 1].t_s > rows[k].t_s:
            for name, value in _row(state, rows[k].t_s - begin).items():
                table[name].append(value)
    return ProgramRun(
        program=names[0] if names else None,
        started_s=begin,
        duration_s=rows[end - 1].t_s - begin,
        ending=Ending.COMPLETED if completed else Ending.ABORTED,
        pauses=_pauses(rows[first:end]),
        columns={name: np.array(values, dtype=COLUMNS[name]) for name, values in table.items()},
    )


COLUMNS: dict[str, type] = {
    "t_s": np.float64,
    "line": np.int64,
    "feed_mm_min": np.float64,
    "spindle_rpm": np.float64,
    "tool_number": np.int64,
    "tool_change_active": np.bool_,
    "exec_state": np.str_,
    "feed_override_pct": np.float64,
    "rapid_override_pct": np.float64,
    "spindle_override_pct": np.float64,
}
"""Columns of a run: those of a run log of kind `program` (line −1, tool −1, NaN = not told yet), and the overrides in percent."""


def _row(state: Mapping[str, str], t_s: float) -> dict[str, float | str | bool]:
    tool = float(state.get("Current_Tool", "nan"))
    row: dict[str, float | str | bool] = {
        "t_s": t_s,
        "line": int(float(state.get("Block_Number", "0"))) - 1,
        "feed_mm_min": float(state.get("Feed_Rate", "nan")) * 60.0,
        "spindle_rpm": float(state.get("Spindle_Speed", "nan")),
        "tool_number": -1 if np.isnan(tool) else int(tool),
        "tool_change_active": tool == 0.0,
        "exec_state": state["Program_Status"],
    }
    row.update({name: float(state.get(key, "nan")) for key, name in OVERRIDES.items()})
    return row


def _pauses(rows: Sequence[Observation]) -> tuple[Pause, ...]:
    """Return the pauses: the runtime counter stands. It counts whole seconds, so that a pause is known to half a second."""
    begin = rows[0].t_s
    counted = [(row.t_s - begin, float(row.value)) for row in rows if row.key == "Program_Runtime_Seconds"]
    good = [
        (t, value)
        for k, (t, value) in enumerate(counted)
        if not _is_wrong(value, counted[k - 1 : k] if k else [], counted[k + 1 : k + 2])
    ]
    pauses = []
    for (t, value), (t_next, value_next) in pairwise(good):
        lost = (t_next - t) - (value_next - value)
        if t_next - t > STANDS_S and value_next >= value and lost > 1.0:
            start = t + 0.5
            pauses.append(Pause(start, start + lost, _reason(rows, begin + t, begin + t_next)))
    return tuple(pauses)


def _is_wrong(value: float, before: Sequence[tuple[float, float]], after: Sequence[tuple[float, float]]) -> bool:
    """A value above the one that follows, or below the one before it: a stale one."""
    return bool((after and value > after[0][1]) or (before and after and value < before[0][1] <= after[0][1]))


def _reason(rows: Sequence[Observation], start: float, end: float) -> str:
    """Return the control's reason for a pause; nothing = it waited at an optional stop, or the recorder did not see why."""
    said = [row.value for row in rows if row.key == "Program_Status" and start <= row.t_s <= end and row.value != "ACTIVE"]
    return said[0] if said else "counter stands"
