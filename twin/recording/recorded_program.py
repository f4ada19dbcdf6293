"""A program beside the recording of one of its runs: what the time model is fitted to and judged on.

The run's own overrides are inputs, not something to fit: what the knobs stood at while a line was executed acts on its segments.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import RunLogError
from twin.motion.path import EventKind, Kind, Path
from twin.motion.plan import Plan
from twin.recording.program_run import Ending, ProgramRun

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
UNSEEN_LINES = 5
"""Lines at the end of a program that take no time of their own: M5, M30."""
OVERRIDE_LEAST = 0.01
"""A knob at 0 stops the axes; the planner's slowest is 1 %."""


class SetUp(NamedTuple):
    """The machine's own positions, seen from the zero of the work, which neither program nor recording tells. mm.

    reference_z: upper reference position (G28); tool_change_x, tool_change_y: where a tool change takes the table
    """

    reference_z: float
    tool_change_x: float
    tool_change_y: float


NOMINAL = SetUp(300.125, -150.125, -250.125)
"""A guess to build the path with; its odd figures are found again in the path and replaced."""


@dataclass(frozen=True, slots=True)
class RecordedProgram:
    """`path` of a program, built with NOMINAL, and one `run` of it."""

    name: str
    path: Path
    run: ProgramRun

    @property
    def tool_changes(self) -> tuple[tuple[int, int], ...]:
        """(line, tool) of each tool change."""
        return tuple((event.line, int(event.value)) for event in self.path.events if event.kind == EventKind.TOOL_CHANGE)

    def refusal(self) -> str:
        """Why this run can't be judged against this program; empty = it can.

        A control that is asked once a second does not show the last lines of a program that came to its end.
        """
        if self.run.ending is not Ending.COMPLETED:
            return "aborted"
        line = np.asarray(self.run.columns["line"])
        last = max((event.line for event in self.path.events), default=0)
        if not last - UNSEEN_LINES <= line.max() <= last:
            return f"ran to line index {line.max()}, the program ends at {last}"
        tool = np.asarray(self.run.columns["tool_number"])
        told = np.concatenate([[False], (tool[1:] != tool[:-1]) & (tool[1:] > 0)])
        edges = [change for change, _ in self.tool_changes] + [last + 1]
        for (change, number), following in zip(self.tool_changes, edges[1:], strict=True):
            seen = set(tool[told & (line >= change) & (line < following)].tolist())
            if seen and number not in seen:
                return f"tool {seen} after line index {change}, the program has {number}: another program ran"
        return ""

    def with_set_up(self, set_up: SetUp) -> Path:
        """The path with the machine's positions elsewhere."""
        path = self.path
        ends = []
        for points in (path.start_mm, path.end_mm):
            moved = points.copy()
            moved[points[:, 2] == NOMINAL.reference_z, 2] = set_up.reference_z
            changing = (points[:, 0] == NOMINAL.tool_change_x) & (points[:, 1] == NOMINAL.tool_change_y)
            moved[changing, :2] = set_up.tool_change_x, set_up.tool_change_y
            ends.append(moved)
        straight = np.sqrt(np.sum((ends[1] - ends[0]) ** 2, axis=1))
        return replace(
            path, start_mm=ends[0], end_mm=ends[1], length_mm=np.where(path.kind == Kind.ARC, path.length_mm, straight)
        )

    def overrides(self) -> tuple[Floats, Floats]:
        """Ratios (n,) for each segment: feed and rapid override, averaged over the active time of its line; not told = 1."""
        begin, line = self.run.line_changes()
        edges = np.append(begin, self.run.active_s)
        feed, rapid = (self._mean_between(name, edges) for name in ("feed_override_pct", "rapid_override_pct"))
        at = np.maximum(np.searchsorted(line, self.path.line, side="right") - 1, 0)
        return feed[at], rapid[at]

    def _mean_between(self, name: str, edges: Floats) -> Floats:
        t = self.run.active(self.run.t_s)
        value = np.asarray(self.run.columns[name], dtype=np.float64) / 100.0
        known = value[~np.isnan(value)]
        value = np.where(np.isnan(value), known[0] if len(known) else 1.0, value)
        covered = np.concatenate([[0.0], np.cumsum(value[:-1] * np.diff(t))])
        total = np.interp(edges, t, covered)
        now = value[np.clip(np.searchsorted(t, edges[:-1], side="right") - 1, 0, len(t) - 1)]
        spans = np.diff(edges)
        return np.maximum(np.where(spans > 0.0, np.diff(total) / np.where(spans > 0.0, spans, 1.0), now), OVERRIDE_LEAST)


def kept_apart(at_s: Floats, least_s: float) -> Ints:
    """Return the indices of times that are `least_s` or more apart, from the first on.

    >>> kept_apart(np.array([0.0, 0.4, 1.2, 1.9, 2.3]), 1.0).tolist()
    [0, 2, 4]
    """
    kept = [0]
    for k in range(1, len(at_s)):
        if at_s[k] - at_s[kept[-1]] >= least_s:
            kept.append(k)
    return np.array(kept, dtype=np.int64)


def windows(program: RecordedProgram, shortest_s: float) -> tuple[Floats, Ints]:
    """Active seconds (k,) and lines (k,) at which the comparison is made, at least `shortest_s` apart."""
    begin, line = program.run.line_changes()
    kept = kept_apart(begin, shortest_s)
    return begin[kept], line[kept]


def line_starts(plan: Plan, lines: Ints) -> Floats:
    """Seconds at which each of `lines` begins in `plan`."""
    seconds = plan.seconds_by_line()
    begins = np.concatenate([[0.0], np.cumsum(seconds)])
    return np.asarray(begins[np.minimum(lines, len(seconds))])


class RapidSeen(NamedTuple):
    """A long rapid of one axis in a recording: when it was seen, and its level speed over the recorded override."""

    t_s: float
    rate_mm_min: float


def rapids_seen(program: RecordedProgram, shortest_mm: float = 100.0) -> list[RapidSeen]:
    """Return the rapids in which one axis alone went `shortest_mm` or more; the speed there is level at rate times override."""
    path, run = program.path, program.run
    _, rapid = program.overrides()
    alone = np.max(np.abs(path.end_mm - path.start_mm), axis=1) > 0.999999 * path.length_mm
    line, feed, t_s = (np.asarray(run.columns[name]) for name in ("line", "feed_mm_min", "t_s"))
    seen = []
    for k in np.flatnonzero(alone & (path.kind == Kind.RAPID) & (path.length_mm >= shortest_mm)):
        here = line == path.line[k]
        if here.any() and np.max(feed[here]) > 0.0:
            seen.append(RapidSeen(float(t_s[here][0]), float(np.max(feed[here])) / float(rapid[k])))
    return sorted(seen)


def rapid_rate_mm_min(programs: Sequence[RecordedProgram], shortest_mm: float = 100.0) -> tuple[float, float]:
    """Return the rapid traverse rate of an axis at 100 % and its spread, from the long rapids of the recordings.

    Raises RunLogError where no recording has such a move.
    """
    read = [seen.rate_mm_min for program in programs for seen in rapids_seen(program, shortest_mm)]
    if not read:
        raise RunLogError(f"no rapid of one axis over {shortest_mm} mm in these recordings: state rapid_mm_min")
    middle = float(np.median(read))
    return middle, float(1.4826 * np.median(np.abs(np.array(read) - middle)))
