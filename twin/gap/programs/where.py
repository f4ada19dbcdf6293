"""The place of the time gap: in which sections of the programs, and in what kind of blocks.

Seconds add up where other signals do not, so the share of a cell is that of its seconds: |Σ gap| over the same summed over all
cells of its signal. `section_time_s` goes from one tool change to the next; `block_time_s` sorts windows of a second or so by
what the program does in them. Whether a cell is more than what repeats is `twin.gap.significance`, over the windows in it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.gap.diagnosis import Cell
from twin.gap.programs.fit import Model, Watched
from twin.gap.programs.search import SHORT_WINDOW_S
from twin.gap.programs.trial import Trial
from twin.gap.significance import discoveries, means_of
from twin.gap.wording import digits, percent
from twin.motion.path import EventKind, Kind, Path
from twin.motion.plan import Plan
from twin.recording.recorded_program import line_starts

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SHORT_BLOCK_S = 0.25
"""A cutting block that would take less at its feed is a short one: it is over before the axes are at speed."""
CHANGE, DWELL, RAPID, SHORT, LONG = "tool change and spindle", "dwell", "rapid", "short blocks", "long blocks"
KINDS = (CHANGE, DWELL, RAPID, SHORT, LONG)
SECTION, BLOCK = "section_time_s", "block_time_s"
EVENT_KINDS = {
    EventKind.TOOL_CHANGE: CHANGE,
    EventKind.SPINDLE: CHANGE,
    EventKind.ORIENT: CHANGE,
    EventKind.PROGRAM_STOP: CHANGE,
    EventKind.DWELL: DWELL,
}


@dataclass(frozen=True)
class Sections:
    """The sections of a run. recorded_s: (s,) active seconds of each; planned by `of`."""

    trial: Trial
    names: tuple[str, ...]
    begin: Floats
    line: Ints

    @classmethod
    def in_run(cls, trial: Trial) -> "Sections":
        """A section begins where its first line, or one after it, is first told."""
        begin, line = trial.recorded.run.line_changes()
        first = np.array([at for at, _ in trial.sections[1:]], dtype=np.int64)
        at = np.minimum(np.searchsorted(line, first), len(line) - 1)
        edges = np.concatenate([[0.0], begin[at], [trial.recorded.run.active_s]])
        lines = np.concatenate([[0], line[at], [np.iinfo(np.int32).max]])
        return cls(trial, tuple(name for _, name in trial.sections), trial.told_s(edges), lines)

    @property
    def recorded_s(self) -> Floats:
        """Active seconds of each."""
        return np.asarray(np.diff(self.begin))

    def planned_s(self, plan: Plan) -> Floats:
        """Seconds of each in a plan."""
        return np.asarray(np.diff(line_starts(plan, self.line)))


@dataclass(frozen=True)
class RunGap:
    """One run beside two plans: windows of a second, sections, and what kind of blocks each window has."""

    watched: Watched
    sections: Sections
    before: Plan
    after: Plan
    kind: Ints

    @classmethod
    def of(cls, trial: Trial, before: Model, after: Model) -> "RunGap":
        """The run with a twin as it was and as it is now."""
        watched = Watched.of(trial, SHORT_WINDOW_S)
        kind = window_kinds(trial.recorded.path, watched.line, before.stated.rapid_mm_min)
        return cls(watched, Sections.in_run(trial), watched.plan(before), watched.plan(after), kind)

    def window_gap(self, after: bool) -> Floats:
        """Twin minus recording in each window, s."""
        return np.asarray(np.diff(self.watched.planned_s(self.after if after else self.before)) - self.watched.recorded_s)

    def section_gap(self, after: bool) -> Floats:
        """Twin minus recording in each section, s."""
        return self.sections.planned_s(self.after if after else self.before) - self.sections.recorded_s

    @property
    def window_section(self) -> Ints:
        """Number of the section in which each window begins."""
        at = np.searchsorted(self.sections.begin[:-1], self.watched.begin[:-1] + 1e-9, side="right") - 1
        return np.asarray(np.maximum(at, 0), dtype=np.int64)

    @property
    def floor_s(self) -> float:
        """Return what the recorder does not know of a window: both ends lie somewhere between two rows."""
        return float(self.watched.trial.resolution_s / np.sqrt(6.0))


def window_kinds(path: Path, line: Ints, rapid_mm_min: float | tuple[float, ...]) -> Ints:
    """Index into KINDS (k − 1,) of what the program does between the lines `line` (k,)."""
    rapid = path.kind == Kind.RAPID
    slowest = min(rapid_mm_min) if isinstance(rapid_mm_min, tuple) else rapid_mm_min
    ideal = 60.0 * path.length_mm / np.where(rapid, slowest, path.feed_mm_min)
    window = np.searchsorted(line, path.line, side="right") - 1
    count = len(line) - 1
    inside = (window >= 0) & (window < count)
    cut, fast, blocks = (
        np.bincount(window[inside & which], weights[inside & which], minlength=count)
        for which, weights in ((~rapid, ideal), (rapid, ideal), (~rapid, np.ones(len(path))))
    )
    kind = np.where(fast > cut, KINDS.index(RAPID), np.where(cut < SHORT_BLOCK_S * blocks, KINDS.index(SHORT), KINDS.index(LONG)))
    for name in (DWELL, CHANGE):
        events = [event.line for event in path.events if EVENT_KINDS.get(event.kind) == name]
        at = np.searchsorted(line, np.array(events, dtype=np.int64), side="right") - 1
        kind[at[(at >= 0) & (at < count)]] = KINDS.index(name)
    return kind.astype(np.int64)


def where(gaps: Sequence[RunGap], section_floor_s: float, *, after: bool = False) -> tuple[Cell, ...]:
    """The cells of the time gap: those that were discovered first, largest share first."""
    window = np.concatenate([gap.window_gap(after) for gap in gaps])
    floor = np.concatenate([np.full(len(gap.kind), gap.floor_s) for gap in gaps])
    section = np.concatenate([np.array(gap.sections.names, dtype=object)[gap.window_section] for gap in gaps])
    kind = np.array(KINDS, dtype=object)[np.concatenate([gap.kind for gap in gaps])]
    whole = np.concatenate([gap.section_gap(after) for gap in gaps])
    names = np.concatenate([np.array(gap.sections.names, dtype=object) for gap in gaps])
    recorded_whole = np.concatenate([gap.sections.recorded_s for gap in gaps])
    recorded = np.concatenate([gap.watched.recorded_s for gap in gaps])
    sorts = [
        _Sorting(SECTION, section, names, whole, recorded_whole, section_floor_s),
        _Sorting(BLOCK, kind, kind, window, recorded, float(np.median(floor))),
    ]
    cells = [(sort, name) for sort in sorts for name in dict.fromkeys(sort.unit.tolist())]
    masks = np.array([sort.window == name for sort, name in cells])
    p = means_of(window / floor, masks).p()
    stands = discoveries(p)
    found = [sort.cell(name, float(p[n]), bool(stands[n]), len(gaps)) for n, (sort, name) in enumerate(cells)]
    return tuple(sorted(found, key=lambda cell: (not cell.discovered, -cell.share)))


@dataclass(frozen=True)
class _Sorting:
    """One way to sort the gap. window: (w,) name of the cell of each window; unit: (u,) that of each gap of `gap` (u,), s."""

    signal: str
    window: NDArray[np.object_]
    unit: NDArray[np.object_]
    gap: Floats
    recorded: Floats
    floor_s: float

    def cell(self, name: str, p: float, discovered: bool, runs: int) -> Cell:
        """A cell in figures and words; seconds are those of one run, on the average."""
        here = self.unit == name
        seconds = {one: float(self.gap[self.unit == one].sum()) for one in dict.fromkeys(self.unit.tolist())}
        share = abs(seconds[name]) / max(sum(abs(s) for s in seconds.values()), 1e-12)
        gap, recorded = self.gap[here], float(self.recorded[here].sum()) / runs
        each = seconds[name] / runs
        took = f"{digits(recorded)} s in a run, {_more(each)}"
        words = f"{percent(share)} of the time gap is in {name}: {took}"
        if not discovered:
            words = f"{name}: within the repeatability ({took})"
        rms = float(np.sqrt(np.mean(gap**2))) / self.floor_s
        return Cell(self.signal, name, share, abs(float(gap.mean())) / self.floor_s, rms, p, discovered, words)


def _more(seconds: float) -> str:
    return f"{digits(abs(seconds))} s {'more' if seconds < 0.0 else 'less'} than the twin says"
