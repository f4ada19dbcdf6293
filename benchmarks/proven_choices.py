"""Programs of one geometry with other feeds and speeds for each tool: what was run, what is predicted, what may be claimed.

A choice (a spindle speed, and feeds) is proven where a run cut the whole section of a tool with it: 99 % of the way in cutting
moves at 98 % feed override or more, and the recorded spindle speed within 2 % of the programmed.
"""

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr, t

from benchmarks.programs.time import fitted, is_fitted
from benchmarks.programs.time_fit import PARAMETERS, ProgramTimes, compare
from twin.motion.candidates import Candidates
from twin.motion.limits import Limits
from twin.motion.path import EventKind, Kind, Path
from twin.motion.plan import plan
from twin.recording.recorded_program import RecordedProgram, line_starts

Floats = NDArray[np.float64]
INCH_MM = 25.4
REFERENCE = "plate 13"
"""The program whose order of tools and knobs a composed one gets: the fastest, its knobs untouched (rapid at 52 %)."""
KEPT_SHARE, KEPT_RATIO, SPINDLE_WITHIN = 0.99, 0.98, 0.02
TURNED = 0.01
"""An override that moves by more within a section was turned there."""
TIE_S = 0.05
CONFIDENCE = 0.95


class Choice(NamedTuple):
    """The choice of a program for a tool: spindle speed, and the feeds in mm/min of its cutting moves (from slow to fast)."""

    rpm: float
    feeds_mm_min: tuple[float, ...]

    def __str__(self) -> str:
        feeds = "+".join(f"{feed / INCH_MM:.4g}" for feed in self.feeds_mm_min)
        return f"S{self.rpm:.0f} F{feeds}"


@dataclass(frozen=True, slots=True)
class Section:
    """A tool section of a run. first: its program begins with it; whole: all of the geometry; touched: a knob was turned."""

    run: str
    tool: int
    choice: Choice
    recorded_s: float
    predicted_s: float
    feed_s: float
    """Length over feed, rapids at their rate: what one says who knows no dynamics."""
    first: bool
    whole: bool
    touched: bool
    proven: bool
    held_out: bool

    @property
    def error_s(self) -> float:
        """Predicted − recorded."""
        return self.predicted_s - self.recorded_s


@dataclass(frozen=True, slots=True)
class Savings:
    """Pairs of runs of a section (or of the whole): predicted and recorded seconds saved by the second against the first."""

    name: str
    runs: int
    pairs: int
    largest_s: float
    rank: float
    feed_rank: float
    error_s: float
    feed_error_s: float
    worst_s: float
    right: int
    clear: int
    """`clear` pairs differ by over 2 % of the section; `right` of them were predicted with the right sign."""


def spans(path: Path) -> list[tuple[int, slice]]:
    """(tool, segments) of each tool section."""
    changes = [(event.segment, int(event.value)) for event in path.events if event.kind == EventKind.TOOL_CHANGE]
    ends = [segment for segment, _ in changes[1:]] + [len(path)]
    return [(tool, slice(segment, end)) for (segment, tool), end in zip(changes, ends, strict=True)]


def choice_of(path: Path, span: slice) -> Choice:
    """Return what `path` says between two tool changes."""
    cutting = path.feed_mm_min[span][path.kind[span] != Kind.RAPID]
    turning = {event.value for event in path.events if _turns(path, event.segment, event.kind, span) and event.value}
    (rpm,) = turning  # one speed for each tool in all ten programs
    return Choice(rpm, tuple(np.unique(np.round(cutting, 6)).tolist()))


def _turns(path: Path, segment: int, kind: EventKind, span: slice) -> bool:
    return kind == EventKind.SPINDLE and (span.start <= segment < span.stop or segment == span.stop == len(path))


def is_proven(program: RecordedProgram, span: slice, choice: Choice) -> bool:
    """Return whether this run cut the section with its programmed feeds and speed."""
    path, run = program.path, program.run
    cutting = path.kind[span] != Kind.RAPID
    way, ratio = path.length_mm[span][cutting], program.overrides()[0][span][cutting]
    kept = float(way[ratio >= KEPT_RATIO].sum() / way.sum()) >= KEPT_SHARE
    here = np.isin(np.asarray(run.columns["line"]), path.line[span][cutting])
    rpm = np.asarray(run.columns["spindle_rpm"], dtype=np.float64)[here]
    return kept and abs(float(np.nanmedian(rpm)) / choice.rpm - 1.0) <= SPINDLE_WITHIN


def sections(program: RecordedProgram, model: ProgramTimes, ideal: Limits, whole_mm: dict[int, float]) -> list[Section]:
    """Each tool section of a run, predicted as the optimiser would and recorded."""
    compared = compare(program, model.plan(program))
    feed, rapid = program.overrides()
    simple = compare(program, plan(program.with_set_up(model.set_up), ideal, feed, rapid))
    made = []
    for n, (one, naive, (tool, span)) in enumerate(zip(compared.sections, simple.sections, spans(program.path), strict=True)):
        choice = choice_of(program.path, span)
        whole = math.isclose(cut_mm(program.path, span), whole_mm.get(tool, math.nan), rel_tol=1e-3)
        proven = whole and is_proven(program, span, choice)
        touched = max(float(np.ptp(ratios[span])) for ratios in (feed, rapid)) > TURNED
        seconds = (one.recorded_s, one.predicted_s, naive.predicted_s)
        made.append(Section(program.name, tool, choice, *seconds, n == 0, whole, touched, proven, not is_fitted(program)))
    return made


def cut_mm(path: Path, span: slice) -> float:
    """Way in cutting moves."""
    return float(path.length_mm[span][path.kind[span] != Kind.RAPID].sum())


def savings(name: str, rows: Sequence[tuple[float, float, float, bool]]) -> Savings:
    """Return the savings of (recorded, predicted, length over feed, first) of each run: pairs of which both or none begin
    their program."""
    pairs = [(a, b) for a, b in combinations(rows, 2) if a[3] == b[3]]
    saved = np.array([[a[k] - b[k] for k in range(3)] for a, b in pairs])
    recorded, predicted, simple = saved.T
    clear = np.abs(recorded) > 0.02 * statistics.mean(row[0] for row in rows)
    columns = np.array([row[:3] for row in rows]).T
    return Savings(
        name,
        len(rows),
        len(pairs),
        float(np.max(np.abs(recorded))),
        float(spearmanr(columns[0], columns[1]).statistic),
        float(spearmanr(columns[0], columns[2]).statistic),
        float(np.mean(np.abs(predicted - recorded))),
        float(np.mean(np.abs(simple - recorded))),
        float(np.max(np.abs(predicted - recorded))),
        int(np.sum(np.sign(predicted[clear]) == np.sign(recorded[clear]))),
        int(np.sum(clear)),
    )


def composed(path: Path, chosen: dict[int, tuple[Path, slice]]) -> Path:
    """`path` with the feeds and speeds that other programs of the same geometry have: tool → (path, its section there)."""
    feed, events = path.feed_mm_min.copy(), list(path.events)
    for tool, span in spans(path):
        if tool not in chosen:
            continue
        donor, there = chosen[tool]
        mine, theirs = (np.flatnonzero(p.kind[s] != Kind.RAPID) for p, s in ((path, span), (donor, there)))
        assert np.array_equal(path.end_mm[span][mine], donor.end_mm[there][theirs]), "another geometry"
        feed[span.start + mine] = donor.feed_mm_min[there][theirs]
        rpm = choice_of(donor, there).rpm
        for k, event in enumerate(events):
            if event.value and _turns(path, event.segment, event.kind, span):
                events[k] = replace(event, value=math.copysign(rpm, event.value))
    return replace(path, feed_mm_min=feed, events=tuple(events))


def by_tool(program: RecordedProgram, path: Path, model: ProgramTimes) -> dict[int, float]:
    """Predicted seconds of each tool section of `path` under the knobs that `program` was run with."""
    planned = replace(program, path=path)
    feed, rapid = program.overrides()
    of = plan(planned.with_set_up(model.set_up), model.limits, feed, rapid)
    changes = program.tool_changes
    edges = line_starts(of, np.array([line for line, _ in changes[1:]], dtype=np.int64))
    seconds = np.diff(np.concatenate([[0.0], edges, [of.total_s]]))
    return {tool: float(s) for (_, tool), s in zip(changes, seconds, strict=True)}


class Proven(NamedTuple):
    """A proven choice of a tool, who ran it, and the section's predicted seconds in a given run."""

    choice: Choice
    runs: tuple[str, ...]
    predicted_s: float
    donor: tuple[Path, slice]


def proven(
    host: RecordedProgram, programs: Sequence[RecordedProgram], known: Sequence[Section], model: ProgramTimes
) -> dict[int, list[Proven]]:
    """For each tool the choices that `programs` have proven, fastest first, predicted with the order and the knobs of `host`."""
    named = {program.name: program for program in programs}
    whole = {section.tool for section in known if section.run == host.name and section.whole}
    rows: dict[int, dict[Choice, list[str]]] = {}
    for section in known:
        if section.proven and section.run in named and section.tool in whole:
            rows.setdefault(section.tool, {}).setdefault(section.choice, []).append(section.run)
    found = {}
    for tool, choices in rows.items():
        options = []
        for choice, runs in choices.items():
            path = named[runs[0]].path
            donor = (path, dict(spans(path))[tool])
            seconds = by_tool(host, composed(host.path, {tool: donor}), model)[tool]
            options.append(Proven(choice, tuple(runs), seconds, donor))
        found[tool] = sorted(options, key=lambda one: one.predicted_s)
    return found


def interval(errors: Sequence[float], share: float = CONFIDENCE) -> tuple[float, float]:
    """Return where the relative error of one more program is expected, from those of some: Student's prediction interval."""
    n = len(errors)
    half = float(t.ppf(0.5 + share / 2.0, n - 1)) * statistics.stdev(errors) * math.sqrt(1.0 + 1.0 / n)
    return statistics.mean(errors) - half, statistics.mean(errors) + half


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A tool of a plate that had no say: what the others' proven choices made of it, beside its recording.

    pick: the fastest of the others; its own choice where that is among the fastest (within TIE_S), so that `same` tells that
    the recorded seconds check the prediction
    """

    run: str
    tool: int
    own: Choice
    pick: Choice
    same: bool
    recorded_s: float
    predicted_s: float
    pick_s: float


def left_out(every: Sequence[RecordedProgram], rows: Sequence[Section], models: dict[str, ProgramTimes]) -> list[LeftOut]:
    """For each plate: control and choices from the others, the choice predicted with this plate's order and knobs."""
    made = []
    for program in every:
        model = models[program.name]
        options = proven(program, [one for one in every if one is not program], rows, model)
        own = by_tool(program, program.path, model)
        for row in (row for row in rows if row.run == program.name and row.whole):
            best = options[row.tool][0]
            tied = [one for one in options[row.tool] if one.predicted_s <= best.predicted_s + TIE_S]
            pick = next((one for one in tied if one.choice == row.choice), best)
            same = pick.choice == row.choice
            made.append(
                LeftOut(program.name, row.tool, row.choice, pick.choice, same, row.recorded_s, own[row.tool], pick.predicted_s)
            )
    return made


@dataclass(frozen=True, slots=True)
class Study:
    """Everything that is printed.

    untouched: savings of the sections in which no knob was turned; options: of all plates, in the order and with the knobs of
    the reference; best_s: the whole with the fastest of each; faster_s: tool → seconds saved by a tenth more feed
    error: relative, 95 % of one more program; saved_error: the same of a saving between two
    batch_gap_s: largest difference between the plan and the evaluation of all programs in one batch
    """

    programs: tuple[RecordedProgram, ...]
    model: ProgramTimes
    rows: tuple[Section, ...]
    tools: tuple[Savings, ...]
    untouched: tuple[Savings, ...]
    whole: Savings
    held_out: Savings
    options: dict[int, list[Proven]]
    best_s: float
    faster_s: dict[int, float]
    error: tuple[float, float]
    saved_error: tuple[float, float]
    checks: tuple[LeftOut, ...]
    batch_gap_s: float


def wholes(rows: Sequence[Section]) -> dict[str, list[Section]]:
    """The sections of each run that made the whole part."""
    runs: dict[str, list[Section]] = {}
    for row in rows:
        runs.setdefault(row.run, []).append(row)
    return {name: of for name, of in runs.items() if all(row.whole for row in of)}


def error_of(rows: Sequence[Section]) -> float:
    """(predicted − recorded) / recorded."""
    return sum(row.error_s for row in rows) / sum(row.recorded_s for row in rows)


def figures(rows: Sequence[Section]) -> tuple[float, float, float, bool]:
    """Recorded, predicted, length over feed, s; whether the program begins with it."""
    first = len(rows) == 1 and rows[0].first
    return sum(r.recorded_s for r in rows), sum(r.predicted_s for r in rows), sum(r.feed_s for r in rows), first


def study(programs: Sequence[RecordedProgram], base_rpm: float) -> Study:
    """From the runs that can be judged."""
    learned = [one for one in programs if is_fitted(one)]
    model = fitted(learned, PARAMETERS, True, base_rpm)
    models = {one.name: model for one in programs}
    for one in learned:
        models[one.name] = fitted([other for other in learned if other is not one], PARAMETERS, True, base_rpm)
    ideal = Limits(rapid_mm_min=model.limits.rapid_mm_min, acceleration_mm_s2=math.inf)
    host = next(one for one in programs if one.name == REFERENCE)
    whole_mm = {tool: cut_mm(host.path, span) for tool, span in spans(host.path)}
    rows = tuple(row for one in programs for row in sections(one, model, ideal, whole_mm))
    of = {tool: [row for row in rows if row.tool == tool and row.whole] for tool in whole_mm}
    calm = {tool: [row for row in of[tool] if not row.touched] for tool in of}
    held = [error_of([row for row in rows if row.run == one.name]) for one in programs if not is_fitted(one)]
    options = proven(host, programs, rows, model)
    best = composed(host.path, {tool: found[0].donor for tool, found in options.items()})
    quicker = by_tool(host, replace(best, feed_mm_min=1.1 * best.feed_mm_min), model)
    slower = by_tool(host, best, model)
    full = [one for one in programs if one.name in wholes(rows)]
    return Study(
        tuple(programs),
        model,
        rows,
        tuple(savings(f"T{tool}", [figures([row]) for row in of[tool]]) for tool in of),
        tuple(savings(f"T{tool}", [figures([row]) for row in calm[tool]]) for tool in calm),
        savings("whole", [figures(each) for each in wholes(rows).values()]),
        savings("held out", [figures(each) for each in wholes(rows).values() if each[0].held_out]),
        options,
        sum(slower.values()),
        {tool: slower[tool] - quicker[tool] for tool in slower},
        interval(held),
        saved_interval([each for each in wholes(rows).values() if each[0].held_out]),
        tuple(left_out(programs, rows, models)),
        batch_gap_s(host, full, model),
    )


def batch_gap_s(host: RecordedProgram, programs: Sequence[RecordedProgram], model: ProgramTimes) -> float:
    """Largest difference between the plan and the optimiser's evaluation of all programs in one batch, in the order of `host`."""
    paths = [composed(host.path, {tool: (one.path, span) for tool, span in spans(one.path)}) for one in programs]
    placed = [replace(host, path=path).with_set_up(model.set_up) for path in paths]
    batch = Candidates.of(placed[0], model.limits, rapid_ratio=0.52)
    values = np.array([[event.value for event in path.events] for path in placed])
    seconds, _ = batch.seconds_and_wear(np.array([path.feed_mm_min for path in placed]), values)
    return float(np.max(np.abs(seconds - [plan(path, model.limits, 1.0, 0.52).total_s for path in placed])))


def saved_interval(runs: Sequence[Sequence[Section]], share: float = CONFIDENCE) -> tuple[float, float]:
    """Return where the error of a predicted saving between two programs is expected, relative to the time of the first.

    The errors of two runs are taken as independent of each other: the standard deviation is √2 times that of one.
    """
    spread = statistics.stdev([error_of(each) for each in runs])
    half = float(t.ppf(0.5 + share / 2.0, len(runs) - 1)) * math.sqrt(2.0) * spread
    return -half, half
