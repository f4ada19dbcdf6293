"""Parts that real machines made, a row a second, as an edge would have told it: NIST plates, covers and boxes, Okuma, Mazak.

A part is one run of a program. Its label is the program that the job was for; its text is the NC text that ran in truth, told
apart by its number of lines (covers and boxes were made from several texts under one label). Values are those last reported. A
tick is gated while the control changes its tool, for `TAIL_S` after it and `LOOK_BACK_S` before it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cnctwin.importing.shdr import recorded_runs
from twin.anomaly.gate import gate
from twin.recording.observations import last_values, read_observations
from twin.recording.program_run import ProgramRun, program_runs
from twin.runlog import RunLog

Floats = NDArray[np.float64]
TICK_S, TAIL_S, LOOK_BACK_S = 1.0, 8.0, 10.0
PART_S_MIN = 40.0
NIST_SIGNALS = ("spindle_rpm", "feed_mm_min")
"""The signals that these controls told: no load, temperature or vibration."""
CONTROL_SIGNALS = ("spindle_load_pct", "feed_mm_min")
"""Without the speed: of two spindles one is mapped, and it stands while the other cuts."""
TEXTS = {
    59: "PLATE BACK FACE",
    1463: "COVER OP3",
    1733: "COVER OP2",
    4909: "COVER OP1",
    5163: "COVER OP1",
    2796: "COVER OP1",
    2795: "COVER OP1",
    1208: "BOX OP2",
    2142: "BOX OP3",
    6119: "BOX OP4",
    9142: "BOX OP1",
    18084: "BOX OP1",
    22032: "BOX OP1",
    16226: "BOX OP5",
    17315: "BOX OP5",
    18764: "BOX OP5",
    18765: "BOX OP5",
}
"""Highest line of a run → the job it was for; some runs ended early."""
ENDED_EARLY = {2796: 5163, 2795: 5163}
"""Highest line of a run that ended early → that of its text."""


@dataclass(frozen=True)
class Part:
    """One run of a program, a row a tick.

    label: the program that the control is said to run; text: the one that it ran; values: (T, signals), NaN = not told
    tool, line: (T,), −1 = not told; state: (T,) execution; gated: (T,)
    """

    name: str
    machine: str
    label: str
    text: str
    started_s: float
    signals: tuple[str, ...]
    values: Floats
    tool: NDArray[np.int64]
    line: NDArray[np.int64]
    feed_override_pct: Floats
    spindle_override_pct: Floats
    state: NDArray[np.str_]
    gated: NDArray[np.bool_]

    @property
    def ticks(self) -> int:
        """Return its length in ticks."""
        return len(self.values)

    @property
    def feed(self) -> Floats:
        """Feed, mm/min, 0 where it is not told."""
        return np.nan_to_num(self.values[:, self.signals.index("feed_mm_min")])

    def labelled(self, label: str) -> "Part":
        """Return the part with another label on it."""
        return replace(self, label=label)

    def without_lines(self) -> "Part":
        """Return the part as a control tells it that tells no line."""
        return replace(self, line=np.full_like(self.line, -1))


def nist_parts(folder: Path, group: str) -> list[Part]:
    """The parts of a group (`plate`, `cover`, `box`) that lasted long enough to tell of, oldest first."""
    before: dict[str, str] = {}
    parts = []
    for path in sorted((folder / "nist" / group).glob("*.txt")):
        observed = read_observations(path.read_text(encoding="utf-8"), path.name)
        parts += [_nist_part(path, number, run) for number, run in enumerate(program_runs(observed, before), start=1)]
        before |= last_values(observed.rows)
    return sorted((part for part in parts if part.ticks * TICK_S >= PART_S_MIN), key=lambda part: part.started_s)


def _nist_part(path: Path, number: int, run: ProgramRun) -> Part:
    group, machine, serial = path.name.split("-")
    highest = int(np.max(run.columns["line"]))
    highest = ENDED_EARLY.get(highest, highest)
    label = TEXTS.get(highest, run.program or f"{group.upper()} with no name")
    if group == "Plate" and highest != min(TEXTS):
        label = f"PLATE-{int(serial[:2])}"
    rows = np.searchsorted(run.t_s, np.arange(0.0, run.duration_s, TICK_S), side="right") - 1
    columns = {name: column[rows] for name, column in run.columns.items()}
    return Part(
        f"{group.lower()} {serial[:2]}/{number}",
        machine,
        label,
        f"{label} ({highest + 1} lines)",
        run.started_s,
        NIST_SIGNALS,
        np.column_stack([columns[name].astype(np.float64) for name in NIST_SIGNALS]),
        _held_tool(columns["tool_number"].astype(np.int64)),
        _line(columns["line"].astype(np.int64)),
        columns["feed_override_pct"].astype(np.float64),
        columns["spindle_override_pct"].astype(np.float64),
        columns["exec_state"].astype(np.str_),
        gate(_changes(columns["tool_number"].astype(np.int64)), TICK_S, TAIL_S, LOOK_BACK_S),
    )


def _held_tool(tool: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the tool in the spindle: the last one where 0 is told, which is a change."""
    at = np.maximum.accumulate(np.where(tool > 0, np.arange(len(tool)), 0))
    return np.where(tool[at] > 0, tool[at], -1)


def _line(line: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the line, of which the control tells nothing for the first second or two of a run."""
    first = int(np.argmax(line >= 0))
    return np.where(np.arange(len(line)) < first, line[first], line)


def _changes(tool: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return where a tool change is told: number 0, or another number than a second ago."""
    return (tool == 0) | np.concatenate([[False], np.diff(tool) != 0])


def control_parts(recording: Path, devices: Path, machine: str) -> list[Part]:
    """The parts in the log of a control's adapter: stretches in which one program was active, oldest first. It tells no line."""
    parts: list[Part] = []
    for run in recorded_runs(recording, devices):
        parts += _active_parts(run, machine, len(parts))
    return parts


def _active_parts(run: RunLog, machine: str, known: int) -> Iterator[Part]:
    ticks = np.arange(0.0, float(run.t_s[-1]) + TICK_S, TICK_S)
    told: Mapping[str, NDArray[np.generic]] = {
        **{name: _as_of(run.t_s, run.columns[name], ticks) for name in run.columns if name != "t_s"},
        **{name: _as_of(run.t_s, run.text[name], ticks) for name in run.text},
    }
    nothing = np.full(len(ticks), np.nan)
    state = np.array([one or "" for one in told.get("exec_state", nothing.astype(object))], dtype=np.str_)
    program = np.array([one or "" for one in told.get("program", nothing.astype(object))], dtype=np.str_)
    is_on = np.isin(state, ("ACTIVE", "FEED_HOLD", "INTERRUPTED"))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], is_on.astype(int), [0]])))
    tool = np.nan_to_num(told.get("tool_number", nothing).astype(np.float64), nan=-1.0).astype(np.int64)
    active = np.nan_to_num(told.get("tool_change_active", nothing).astype(np.float64)) > 0.0
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if (last - first) * TICK_S < PART_S_MIN:
            continue
        span = slice(first, last)
        known += 1
        yield Part(
            f"{machine.lower()} {known}",
            machine,
            str(program[first]),
            str(program[first]),
            float(ticks[first]),
            CONTROL_SIGNALS,
            np.column_stack([told.get(name, nothing)[span].astype(np.float64) for name in CONTROL_SIGNALS]),
            tool[span],
            np.full(last - first, -1, dtype=np.int64),
            told.get("feed_override_pct", nothing)[span].astype(np.float64),
            told.get("spindle_override_pct", nothing)[span].astype(np.float64),
            state[span],
            gate(active[span], TICK_S, TAIL_S, LOOK_BACK_S),
        )


def _as_of(t_s: Floats, column: NDArray[np.generic], ticks: Floats) -> NDArray[np.generic]:
    """Return the last value that was told as of each tick."""
    is_told = np.array([one is not None for one in column]) if column.dtype == object else np.isfinite(column.astype(np.float64))
    times, values = t_s[is_told], column[is_told]
    if not len(values):
        return np.full(len(ticks), None if column.dtype == object else np.nan)
    at = np.searchsorted(times, ticks, side="right") - 1
    return np.where(at >= 0, values[np.maximum(at, 0)], None if column.dtype == object else np.nan)


def by_text(parts: Sequence[Part]) -> dict[str, list[Part]]:
    """Return the parts by the text that ran."""
    found: dict[str, list[Part]] = {}
    for part in parts:
        found.setdefault(part.text, []).append(part)
    return found


def operations(part: Part) -> Iterator[tuple[str, NDArray[np.int64]]]:
    """Yield the operations of a part, as `T3|1`, and the ticks of each."""
    edges = [0, *(np.flatnonzero(np.diff(part.tool)) + 1).tolist(), part.ticks]
    uses: dict[int, int] = {}
    for first, last in pairwise(edges):
        tool = int(part.tool[first])
        uses[tool] = uses.get(tool, 0) + 1
        yield f"T{tool}|{uses[tool]}", np.arange(first, last)
