"""Diagnoses the sim-to-real gap of a case: where it lies, what causes it, how far it shrinks, and what can't be told.

floors and disturbance → cut and spindle → axes → heat: constants refitted, effects searched (`twin.gap.search`)
    → the twin before and after, on runs that were not fitted → where, shares, intervals → verdict → next experiment
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.assumed import narrowed_in_words, with_fitted
from twin.case import Case, Run, RunKind
from twin.errors import CaseError
from twin.gap.answer import candidates_of, causes_of, found_effects, not_identifiable_of, not_observable_of
from twin.gap.diagnosis import Diagnosed, Diagnosis, Effected, GapNumbers, SignalGap, Verdict, closure_of
from twin.gap.experiment.what_next import what_next
from twin.gap.inspection import inspected, slow_effects
from twin.gap.intervals import closure_interval
from twin.gap.joined import joined
from twin.gap.learned.answer import described_stages, learned_of, with_learned
from twin.gap.naming.constants import moved_constants
from twin.gap.naming.own_units import in_own_units
from twin.gap.naming.sentence import sentence_of
from twin.gap.null import NULL, Null
from twin.gap.parts.opened import combined
from twin.gap.parts.subsystems import subsystems_of
from twin.gap.patterns import patterns
from twin.gap.programs.diagnose import diagnose_programs
from twin.gap.refitted import constant_deviations, with_constants, with_effects, with_uncertainty
from twin.gap.score import Squares, gap_of, squares_of, traces_of
from twin.gap.shares import shapley
from twin.gap.stages.plan import Ground, SideBySide, explained_stages, ground_of
from twin.gap.stages.shown import shown_by_run
from twin.gap.stages.without_column import beside_columns
from twin.gap.units import unit_of
from twin.gap.verdict import Judged, judged, overall
from twin.gap.where import where
from twin.machine import MachineFile

Floats = NDArray[np.float64]
Shown = Mapping[str, Mapping[str, Floats]]
FAR_ABOVE = 2.0
"""Floors of a signal above which a machine is not healthy, though all of it may be in a few places that no stage minds."""


@dataclass(frozen=True, slots=True, eq=False)
class _Twins:
    """The machine with constants refitted, and with causes added; what both, and it as stated, show on the judging runs."""

    before: MachineFile
    after: MachineFile
    runs: tuple[Run, ...]
    squares: Mapping[str, Mapping[str, Squares]]
    shown: Mapping[str, Shown]


def diagnose(
    case: Case,
    *,
    without: frozenset[str] = frozenset(),
    null: Null = NULL,
    clock: Callable[[], float] = lambda: 0.0,
    progress: Callable[[str], None] = lambda _: None,
    side_by_side: SideBySide = map,
) -> Diagnosed:
    """The diagnosis of a case.

    without: effects that are left out of the catalogue; clock: seconds, to say how long it took
    side_by_side: as `map`, for stages that do not wait for each other

    Raises TwinError where there is nothing that could be diagnosed, in one line.
    """
    began = clock()
    programs = bool(case.of(RunKind.PROGRAM, "fit"))
    machine = len(case.of(RunKind.PROGRAM)) < len(case.runs)
    parts: list[Callable[[], Diagnosed]] = []
    if machine:
        parts.append(lambda: _motion(case, without, null, progress, side_by_side))
    if programs or not machine:
        parts.append(lambda: diagnose_programs(case, without=without, progress=progress))
    answers, refused = _answers(parts, case.name)
    found = answers[0] if len(answers) == 1 else joined(*answers)
    found = in_own_units(found, case.machine)
    said = (*found.diagnosis.notes, *refused)
    return replace(found, diagnosis=replace(found.diagnosis, notes=said, seconds=round(clock() - began, 1)))


def _answers(parts: Sequence[Callable[[], Diagnosed]], name: str) -> tuple[list[Diagnosed], list[str]]:
    """Return the diagnosis of each part of a case, and why others have none. Raises CaseError where none has any."""
    answers, refused = [], []
    for part in parts:
        try:
            answers.append(part())
        except CaseError as error:
            refused.append(str(error).removeprefix(f"{name}: "))
    if not answers:
        raise CaseError(f"{name}: {refused[0]}")
    return answers, refused


def _motion(
    case: Case, without: frozenset[str], null: Null, progress: Callable[[str], None], side_by_side: SideBySide
) -> Diagnosed:
    """The diagnosis of all runs but those of kind `program`."""
    progress("reading the runs")
    checked, notes = inspected(case)
    ground = ground_of(checked, without | slow_effects(checked))
    found = [judged(one) for one in explained_stages(ground, progress, side_by_side, null)]
    both = combined(ground, found, progress, side_by_side, null)
    stages = both.stages
    ground = replace(ground, floors=replace(ground.floors, opened=both.floors))
    if not stages:
        raise CaseError(
            f"{case.name}: no run of role fit moves an axis, cuts or warms up beside its reference; nothing to diagnose"
        )
    progress("before and after")
    twins = _twins(ground, stages)
    causes = tuple(dict.fromkeys(e for s in stages for e in s.explained.best.effects))
    shares = shapley(causes, lambda some: _closed(ground, stages, twins, some))
    traces = traces_of(twins.runs, twins.shown["before"], twins.shown["after"], ground.floors)
    numbers, named = _numbers(twins), causes_of(stages, shares, case.assumed)
    verdict = overall(stages)
    if verdict is Verdict.HEALTHY and any(s.before > FAR_ABOVE * s.floor for s in numbers.by_signal.values()):
        verdict = Verdict.UNKNOWN
    learned = described_stages(stages, progress, null)
    progress("what next")
    diagnosis = Diagnosis(
        verdict=verdict,
        sentence="",
        where=where(traces),
        where_after=(left := where(traces, after=True)),
        patterns=patterns(traces, {run.name: run.log for run in twins.runs}, ground.machine),
        causes=named,
        gap=numbers,
        candidates=candidates_of(stages, null),
        not_observable=not_observable_of(checked, stages, without),
        not_identifiable=not_identifiable_of(stages),
        next_experiment=what_next(ground, twins.before, twins.after, stages, left),
        subsystems=subsystems_of(stages, both.opened),
        notes=notes + both.notes + ground.floors.notes + _flattering(checked, twins.runs) + _of_stages(stages),
        seconds=0.0,
        constants=moved_constants(ground.machine, [stage.explained for stage in stages]),
        learned=learned_of(learned),
    )
    diagnosis = replace(diagnosis, sentence=sentence_of(diagnosis, stages))
    known: dict[str, float] = {}
    for stage in stages:
        known |= constant_deviations(twins.after, stage.explained.stage, stage.explained.best)
    after = with_fitted(with_uncertainty(twins.after, known, named), known)
    diagnosis = replace(diagnosis, notes=diagnosis.notes + narrowed_in_words(ground.machine, after))
    return Diagnosed(diagnosis, with_learned(after, learned), traces)


def _of_stages(stages: Sequence[Judged]) -> tuple[str, ...]:
    return tuple(note for stage in stages for note in stage.explained.notes)


def _flattering(case: Case, runs: tuple[Run, ...]) -> tuple[str, ...]:
    """Says it where the runs that were to be judged on record nothing, and those that were fitted had to serve."""
    if not case.of(role="check") or any(run.entry.role == "check" for run in runs):
        return ()
    return ("no run of role check records anything to compare: this is judged on the runs that were fitted, which flatters",)


def _twins(ground: Ground, stages: Sequence[Judged]) -> _Twins:
    runs = tuple(r for r in ground.runs if r.entry.role == "check")
    stated = shown_by_run(ground.machine, runs, ground.floors)
    if not squares_of(runs, stated, ground.floors) and not beside_columns(stages, frozenset()):
        runs = tuple(r for r in ground.runs if r.entry.role == "fit")
        stated = shown_by_run(ground.machine, runs, ground.floors)
    before, after = ground.machine, ground.machine
    for stage in stages:
        before = with_constants(before, stage.explained.stage, stage.explained.base)
        after = with_constants(after, stage.explained.stage, stage.explained.best)
    after = with_effects(after, found_effects(stages))
    shown = {"stated": stated}
    shown |= {name: shown_by_run(m, runs, ground.floors) for name, m in (("before", before), ("after", after))}
    squares = {name: squares_of(runs, columns, ground.floors) for name, columns in shown.items()}
    every = frozenset(dict(found_effects(stages)))
    for name, some in (("stated", None), ("before", frozenset[Effected]()), ("after", every)):
        squares[name] |= beside_columns(stages, some)
    return _Twins(before, after, runs, squares, shown)


def _closed(ground: Ground, stages: Sequence[Judged], twins: _Twins, some: frozenset[Effected]) -> float:
    """Return what the twin with some of the causes closes of the gap of the one with none."""
    causes = dict(found_effects(stages))
    if not some:
        return 0.0
    if len(some) == len(causes):
        squares = twins.squares["after"]
    else:
        machine = ground.machine
        for stage in stages:
            found = stage.explained.best if any(e in some for e in stage.explained.best.effects) else stage.explained.base
            machine = with_constants(machine, stage.explained.stage, found)
        machine = with_effects(machine, [(e, v) for e, v in causes.items() if e in some])
        squares = squares_of(twins.runs, shown_by_run(machine, twins.runs, ground.floors), ground.floors)
        squares |= beside_columns(stages, some)
    return closure_of(gap_of(twins.squares["before"]), gap_of(squares), 1.0)


def _numbers(twins: _Twins) -> GapNumbers:
    before, after = twins.squares["before"], twins.squares["after"]
    closure, low, high = closure_interval(before, after)
    by_signal = {
        signal: SignalGap(squares.rms(), after[signal].rms(), squares.floor(), unit_of(signal))
        for signal, squares in before.items()
    }
    return GapNumbers(gap_of(twins.squares["stated"]), gap_of(before), gap_of(after), 1.0, closure, low, high, by_signal)
