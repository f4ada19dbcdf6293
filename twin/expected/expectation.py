"""An expectation: all runs of all lines of a program on a machine, and the look-up by line.

    P = F π D n / 60        load = meter(P, n)        F = F(advance that is run / advance that is planned)

A line that runs several times (a loop, a subprogram) has the mean of its runs, of one tool where the tool is given; `followed`
finds the run by the order of the lines, and `along_mm` the place within it.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from twin.expected.expected import Expected, Run, Stretch, force_at, mean_forces
from twin.expected.lines import Numbering
from twin.expected.meter import Meter

TURNING_RPM = 1.0
WATTS = math.pi / 6e7
"""kW for 1 N at 1 mm of diameter and 1 rev/min."""


@dataclass(frozen=True, eq=False)
class Expectation:
    """The expectation of a program on a machine. basis: sentences on what it rests on and what is left out

    program_sha256, description: of the texts that it was worked out from; runs: in the order in which they are run
    o_word: the number that the program gives itself; empty = none
    file: name of the program's file, with its ending; empty = not known
    meter: None where the machine has no [spindle], so that no load is known
    """

    program: str
    machine: str
    numbering: Numbering
    runs: tuple[Run, ...]
    meter: Meter | None
    basis: tuple[str, ...]
    program_sha256: str = ""
    description: str = ""
    o_word: str = ""
    file: str = ""

    @cached_property
    def runs_of_line(self) -> dict[int, tuple[int, ...]]:
        """Line → the indices of its runs, in order."""
        found: dict[int, list[int]] = {}
        for k, run in enumerate(self.runs):
            found.setdefault(run.line, []).append(k)
        return {line: tuple(own) for line, own in found.items()}

    @cached_property
    def lines(self) -> dict[tuple[int, int | None], Run]:
        """(line, tool) and (line, None) → the mean of the runs of a line by this tool, by any tool."""
        return {key: _mean([self.runs[k] for k in own]) for key, own in self._runs_by.items()}

    @cached_property
    def _runs_by(self) -> dict[tuple[int, int | None], list[int]]:
        found: dict[tuple[int, int | None], list[int]] = {}
        for k, run in enumerate(self.runs):
            found.setdefault((run.line, run.tool), []).append(k)
            found.setdefault((run.line, None), []).append(k)
        return found

    @cached_property
    def _placed(self) -> dict[tuple[int, int | None], Run]:
        """The lines that run once and have several stretches."""
        return {
            key: self.runs[own[0]] for key, own in self._runs_by.items() if len(own) == 1 and len(self.runs[own[0]].stretches) > 1
        }

    @cached_property
    def _means(self) -> tuple[Run, ...]:
        return tuple(_mean([run]) for run in self.runs)

    @property
    def time_s(self) -> float:
        """Return the time that the program takes."""
        return sum(run.time_s for run in self.runs)

    def at(
        self,
        line: int | None,
        feed_mm_min: float | None = None,
        rpm: float | None = None,
        *,
        tool: int | None = None,
        run: int | None = None,
        along_mm: float | None = None,
    ) -> Expected | None:
        """Return the expectation at a line, at the feed and speed that are run (else as planned); None where no such line runs.

        tool: for a line that several tools run; run: index into `runs`, as `followed` finds it; along_mm: since it began
        """
        if line is None:
            return None
        if run is not None:
            own = self._means[run] if along_mm is None else self.runs[run]
        else:
            lines = self.lines
            key = (line, tool) if (line, tool) in lines else (line, None)
            found = lines.get(key)
            if found is None:
                return None
            own = found if along_mm is None else self._placed.get(key, found)
        stretches = own.stretches
        if not stretches:
            return tuple.__new__(Expected, (math.nan, math.nan, own.feed_mm_min, own.spindle_rpm, math.nan, own.time_s))
        place = 0 if len(stretches) == 1 or along_mm is None else _place(stretches, along_mm)
        forces_n = stretches[place].forces_n
        cut_pct, load_pct, force_n = self._loads(own, forces_n, feed_mm_min, rpm)
        return tuple.__new__(Expected, (cut_pct, load_pct, own.feed_mm_min, own.spindle_rpm, force_n, own.time_s))

    def cut_load_between(
        self,
        line: int,
        from_mm: float = 0.0,
        to_mm: float = math.inf,
        feed_mm_min: float | None = None,
        rpm: float | None = None,
        tool: int | None = None,
    ) -> tuple[float, float] | None:
        """Return the least and the greatest load of the cut, %, between two places of a line, over all its runs.

        None where no such line runs, or where its load is not known in one of its runs.
        """
        runs = self._runs_by.get((line, tool)) or self._runs_by.get((line, None)) or []
        least, most = math.inf, -math.inf
        for run in (self.runs[k] for k in runs):
            if not run.stretches:
                return None
            last = _place(run.stretches, to_mm)
            for stretch in run.stretches[min(_place(run.stretches, from_mm), last) : last + 1]:
                cut_pct = self._loads(run, stretch.forces_n, feed_mm_min, rpm)[0]
                if math.isnan(cut_pct):
                    return None
                least, most = min(least, cut_pct), max(most, cut_pct)
        return (least, most) if runs else None

    @cached_property
    def in_words(self) -> str:
        """The basis as one text."""
        return "; ".join(self.basis)

    def planned(self, line: int, tool: int | None = None) -> Run | None:
        """Return the mean of the runs of a line as planned, by this tool where it runs it; None where no such line runs."""
        return self.lines.get((line, tool)) or self.lines.get((line, None))

    def length_mm(self, line: int, tool: int | None = None) -> float:
        """Return the greatest length of a run of a line, 0 where it does not run."""
        return self._lengths.get((line, tool)) or self._lengths.get((line, None), 0.0)

    @cached_property
    def _lengths(self) -> dict[tuple[int, int | None], float]:
        return {key: max(self.runs[k].length_mm for k in own) for key, own in self._runs_by.items()}

    def why_not(self, line: int | None, tool: int | None = None) -> str:
        """Return why the load of a line is not known; empty = it is, or no such line runs."""
        if line is None:
            return ""
        own = self.planned(line, tool)
        return "" if own is None else own.why_not

    def followed(self, run: int | None, line: int, tool: int | None = None) -> int | None:
        """Return the run that a control is in at `line`, after it was in `run`: the next of this line, else the first again."""
        own = self.runs_of_line.get(line)
        if own is None:
            return None
        if run is not None and self.runs[run].line == line and tool in (None, self.runs[run].tool):
            return run
        later = own[bisect_right(own, -1 if run is None else run) :]
        fitting = (k for k in (*later, *own) if tool is None or self.runs[k].tool == tool)
        return next(fitting, (later or own)[0])

    def peak_of(self, run: Run) -> tuple[float, float] | None:
        """Return the greatest load and force of a run as planned; None where they are not known."""
        found = [self._loads(run, stretch.forces_n, None, None) for stretch in run.stretches]
        return max(((load, force) for _, load, force in found), key=lambda pair: pair[1], default=None)

    def _loads(
        self, run: Run, forces_n: Sequence[float], feed_mm_min: float | None, rpm: float | None
    ) -> tuple[float, float, float]:
        """Return the load of the cut, the load, and the force."""
        turns = run.spindle_rpm if rpm is None else abs(rpm)
        force_n = 0.0
        if turns >= TURNING_RPM and run.spindle_rpm >= TURNING_RPM and run.feed_mm_min > 0.0:
            ratio = (1.0 if feed_mm_min is None else feed_mm_min / run.feed_mm_min) * run.spindle_rpm / turns
            force_n = force_at(forces_n, ratio)
        if self.meter is None:
            return math.nan, math.nan, force_n
        return (*self.meter.at(WATTS * force_n * run.diameter_mm * turns, turns), force_n)


def _place(stretches: Sequence[Stretch], along_mm: float) -> int:
    """Return the index of the stretch at a distance since the line began."""
    for k, stretch in enumerate(stretches):
        if along_mm < stretch.until_mm:
            return k
    return len(stretches) - 1


def _mean(every: Sequence[Run]) -> Run:
    """Return the mean of the runs of a line, of one stretch: force by distance, feed by time, speed by distance."""
    first, count = every[0], len(every)
    length_mm = sum(run.length_mm for run in every)
    if count == 1:
        return (
            first if len(first.stretches) <= 1 else first._replace(stretches=(Stretch(length_mm, mean_forces(first.stretches)),))
        )
    weights = [run.length_mm / length_mm if length_mm > 0.0 else 1.0 / count for run in every]
    unknown = next((run.why_not for run in every if not run.stretches), "")
    stretches: tuple[Stretch, ...] = ()
    if not unknown:
        until, parts = 0.0, []
        for run, weight in zip(every, weights, strict=True):
            until += weight
            parts.append(Stretch(until, mean_forces(run.stretches)))
        stretches = (Stretch(length_mm / count, mean_forces(parts)),)
    moving_s = sum(60.0 * run.length_mm / run.feed_mm_min for run in every if run.feed_mm_min > 0.0)
    return first._replace(
        feed_mm_min=60.0 * length_mm / moving_s if moving_s > 0.0 else 0.0,
        spindle_rpm=sum(run.spindle_rpm * weight for run, weight in zip(every, weights, strict=True)),
        diameter_mm=sum(run.diameter_mm * weight for run, weight in zip(every, weights, strict=True)),
        length_mm=length_mm / count,
        time_s=sum(run.time_s for run in every) / count,
        stretches=stretches,
        why_not=unknown,
    )
