"""Recordings of the machines of a cell: the n-th run of each machine is the same stretch of time, aligned on t_s."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cnctwin.errors import UsageError
from twin.errors import RunLogError
from twin.runlog import RunLog, read_run

MACHINES_MAX = 100
TICKS_MAX = 20_000_000
Stretch = Mapping[str, RunLog]
TOOL_CHANGE = "tool_change_active"


@dataclass(frozen=True, slots=True)
class RecordedCell:
    """stretches: one run of each machine, of the same time, in the order of the files; files: as they were given, by machine"""

    machines: tuple[str, ...]
    stretches: tuple[Stretch, ...]
    files: Mapping[str, tuple[str, ...]]

    @property
    def hours(self) -> float:
        """The hours of all stretches, from the first to the last sample of any machine."""
        return sum(span_s(stretch)[1] - span_s(stretch)[0] for stretch in self.stretches) / 3600.0


def shared_features(arguments: Sequence[str], wanted: Sequence[str]) -> tuple[str, ...]:
    """Those of the wanted signals that all files have. Raises UsageError where a file is no run log, or they have none."""
    runs = [_run(Path(argument.rpartition("=")[2]), (), 1.0) for argument in arguments]
    shared = tuple(name for name in wanted if all(run.has(name) for run in runs))
    if not shared:
        raise UsageError(f"none of {', '.join(wanted)} is in all files: choose with --features")
    return shared


def span_s(stretch: Stretch) -> tuple[float, float]:
    """From the first to the last sample of any machine."""
    return min(float(run.t_s[0]) for run in stretch.values()), max(float(run.t_s[-1]) for run in stretch.values())


def recorded_cell(arguments: Sequence[str], features: Sequence[str], tick_s: float) -> RecordedCell:
    """The runs in `[NAME=]FILE` …; files without a name are one machine's, named after the first of them.

    Raises UsageError where a file is no run log, lacks a feature, or machines have different numbers of runs.
    """
    files: dict[str, list[Path]] = {}
    unnamed = ""
    for argument in arguments:
        name, named, path = argument.rpartition("=")
        if not named:
            unnamed = unnamed or Path(path).stem
        files.setdefault(name or unnamed, []).append(Path(path))
    if len(files) > MACHINES_MAX:
        raise UsageError(f"{len(files)} machines; a cell has at most {MACHINES_MAX}")
    counts = {name: len(paths) for name, paths in files.items()}
    if len(set(counts.values())) > 1:
        told = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise UsageError(f"the machines have different numbers of runs ({told}): the n-th run of each has to be of the same time")
    runs = {name: [_run(path, features, tick_s) for path in paths] for name, paths in files.items()}
    stretches = tuple({name: runs[name][place] for name in runs} for place in range(max(counts.values())))
    for stretch in stretches:
        starts, ends = [run.t_s[0] for run in stretch.values()], [run.t_s[-1] for run in stretch.values()]
        if max(starts) >= min(ends):
            raise UsageError(
                f"{', '.join(run.source for run in stretch.values())}: have no time in common: t_s has to be one clock"
            )
    return RecordedCell(tuple(files), stretches, {name: tuple(map(str, paths)) for name, paths in files.items()})


def _run(path: Path, features: Sequence[str], tick_s: float) -> RunLog:
    try:
        run = read_run(path)
    except RunLogError as error:
        raise UsageError(str(error)) from None
    if absent := [name for name in features if not run.has(name)]:
        there = ", ".join(column for column in run.columns if run.has(column)) or "no signals"
        raise UsageError(f"{path}: there is no {', '.join(absent)} in it; there are {there}: choose with --features")
    if (run.t_s[-1] - run.t_s[0]) / tick_s > TICKS_MAX:
        raise UsageError(f"{path}: more than {TICKS_MAX} ticks of {tick_s:g} s: make --tick-s longer, or split the file")
    return run


def part(run: RunLog, from_s: float, to_s: float) -> RunLog | None:
    """The samples from `from_s` to before `to_s`, the first with what was last said before it; None where there are none."""
    first, last = int(np.searchsorted(run.t_s, from_s)), int(np.searchsorted(run.t_s, to_s))
    if first >= last:
        return None
    columns = {}
    for name, values in run.columns.items():
        kept = values[first:last].copy()
        known = np.flatnonzero(np.isfinite(values[: first + 1]))
        if len(known):
            kept[0] = values[known[-1]]
        columns[name] = kept
    text = {}
    for name, words in run.text.items():
        told = words[first:last].copy()
        told[0] = next((word for word in reversed(words[: first + 1]) if word), None)
        text[name] = told
    return RunLog(run.t_s[first:last], columns, text, (), run.source)
