"""The answer on recorded programs: what a search found, put into the form of every diagnosis.

Root mean squares are over the sections of the runs judged on; an effect's share of what is closed is its Shapley value, the mean
over all orders of adding the causes (Shapley 1953).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import factorial

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import effect_named
from twin.effects.effect import Excitation
from twin.gap.diagnosis import (
    Candidate,
    Cause,
    Diagnosed,
    Diagnosis,
    Effected,
    GapNumbers,
    NextExperiment,
    NotObservable,
    SignalGap,
    Subsystem,
    Trace,
    Verdict,
    closure_of,
)
from twin.gap.programs.fit import LONG_WINDOW_S, Model, Values, Watched
from twin.gap.programs.search import Names, Search
from twin.gap.programs.trial import Trial
from twin.gap.programs.where import BLOCK, SECTION, RunGap, Sections, where
from twin.gap.refitted import with_uncertainty
from twin.gap.wording import digits, percent
from twin.machine import AddedEffect, MachineFile, Program
from twin.motion.limits import ACCELERATION_MAX_MM_S2, Limits
from twin.motion.path import Kind
from twin.recording.program_run import OVERRIDES

Floats = NDArray[np.float64]

AT_FLOOR = 2.0
"""A gap of up to this many floors is none: a recorder's error and that of the parameters fitted to it."""
MOSTLY = 0.5
"""A part of the reducible gap from which on it is explained in part."""
DRAWS = 1000
STAIRS = "G21 G90 G17\nG0 X0 Y0 Z50\n{}G1 X100 F3000\nG0 Y10\nG1 X0\nM30\n".format(
    "".join(f"G1 X{0.2 * k:.1f} F3000\n" for k in range(1, 251))
)
RUN_UPS = "G21 G90 G17\nG0 Z50\nS3000 M3\nG1 X1 F1000\nM5\nG4 P3000\nS9000 M3\nG1 X2 F1000\nM5\nG4 P3000\nT1 M6\nT2 M6\nM30\n"


@dataclass(frozen=True)
class Trials:
    """The runs of a case that can be compared with their programs, and the machine that they are to be explained by.

    stated: its limits as stated or read off; already: its own effects; notes: on the runs and limits
    """

    machine: MachineFile
    stated: Limits
    already: Values
    learnt: tuple[Trial, ...]
    judged: tuple[Trial, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Answer:
    """The search put into the form of a diagnosis."""

    trials: Trials
    found: Search
    absent: tuple[NotObservable, ...]
    rng: np.random.Generator

    def diagnosed(self) -> Diagnosed:
        """Everything."""
        trials, after = self.trials, self.found.chosen.fitted.model
        before = Model(trials.stated, trials.already, after.reference_mm)
        gaps = [RunGap.of(trial, before, after) for trial in trials.judged]
        floor = self._section_floor(gaps)
        numbers = self._numbers(gaps, floor)
        causes = self._causes(gaps, floor, numbers)
        verdict = self._verdict(numbers)
        diagnosis = Diagnosis(
            verdict=verdict,
            sentence=_sentence(verdict, gaps, causes),
            where=where(gaps, floor),
            where_after=where(gaps, floor, after=True),
            patterns=(),
            causes=causes,
            gap=numbers,
            candidates=self._candidates(gaps, floor),
            not_observable=self.absent,
            not_identifiable=self._not_identifiable(),
            next_experiment=self._next(),
            notes=(*trials.notes, *self._notes(gaps)),
            seconds=0.0,
            subsystems=(self._subsystem(numbers, verdict),),
        )
        twin = with_uncertainty(self.twin(), {}, causes)
        return Diagnosed(diagnosis, twin, tuple(t for gap in self._all(gaps, before, after) for t in _traces(gap)))

    def _subsystem(self, numbers: GapNumbers, verdict: Verdict) -> Subsystem:
        told = any(trial.overrides_told for trial in self.trials.judged)
        driven_by = ("program", *(OVERRIDES.values() if told else ()))
        causes = tuple(sorted(self.found.chosen.names))
        return Subsystem("program", driven_by, "line", numbers.before, numbers.after, verdict, causes)

    def _all(self, gaps: list[RunGap], before: Model, after: Model) -> list[RunGap]:
        judged = {gap.watched.trial.name for gap in gaps}
        more = [RunGap.of(trial, before, after) for trial in self.trials.learnt if trial.name not in judged]
        return [*gaps, *more]

    def twin(self) -> MachineFile:
        """The machine with the causes among its effects, and the rapid rate that was read off."""
        machine, chosen = self.trials.machine, self.found.chosen
        added = tuple(
            AddedEffect(effect=name, parameters=dict(chosen.fitted.model.effects[name])) for name in sorted(chosen.names)
        )
        rate = self.trials.stated.rapid_mm_min
        assert machine.program is not None or isinstance(rate, float)
        program = machine.program or Program(rapid_mm_min=float(rate), acceleration_mm_s2=ACCELERATION_MAX_MM_S2)  # type: ignore[arg-type]
        return machine.model_copy(update={"program": program, "effects": (*machine.effects, *added)})

    def _section_floor(self, gaps: list[RunGap]) -> float:
        """Return the difference of runs of the same program, per section, s; not less than what the recorder cannot tell."""
        by_text: dict[str, list[Floats]] = {}
        for trial in {trial.name: trial for trial in (*self.trials.learnt, *self.trials.judged)}.values():
            by_text.setdefault(trial.text, []).append(Sections.in_run(trial).recorded_s)
        pairs = [one - other for same in by_text.values() for one, other in combinations(same, 2)]
        return max([_recorder_s(gaps), *(_rms(pair) / float(np.sqrt(2.0)) for pair in pairs)])

    def _numbers(self, gaps: list[RunGap], floor: float) -> GapNumbers:
        """rms over sections, over windows and over whole runs."""
        as_stated = Model(self.trials.stated, self.trials.already, 0.0)
        stated = np.concatenate([gap.sections.planned_s(gap.watched.plan(as_stated)) - gap.sections.recorded_s for gap in gaps])
        sections = [np.concatenate([gap.section_gap(after) for gap in gaps]) for after in (False, True)]
        totals = [np.array([gap.section_gap(after).sum() for gap in gaps]) for after in (False, True)]
        blocks = [np.concatenate([gap.window_gap(after) for gap in gaps]) for after in (False, True)]
        spread = _closures(sections[0], sections[1], floor, self.rng)
        return GapNumbers(
            as_stated=_rms(stated) / floor,
            before=_rms(sections[0]) / floor,
            after=_rms(sections[1]) / floor,
            floor=1.0,
            closure=closure_of(_rms(sections[0]), _rms(sections[1]), floor),
            closure_low=float(np.quantile(spread, 0.05)),
            closure_high=float(np.quantile(spread, 0.95)),
            by_signal={
                SECTION: SignalGap(_rms(sections[0]), _rms(sections[1]), floor, "s"),
                "program_time_s": SignalGap(_rms(totals[0]), _rms(totals[1]), floor, "s"),
                BLOCK: SignalGap(_rms(blocks[0]), _rms(blocks[1]), _recorder_s(gaps), "s"),
            },
        )

    def _verdict(self, numbers: GapNumbers) -> Verdict:
        if not self.found.chosen.names:
            return Verdict.HEALTHY if numbers.before <= AT_FLOOR * numbers.floor else Verdict.UNKNOWN
        if numbers.after <= AT_FLOOR * numbers.floor:
            return Verdict.EXPLAINED
        return Verdict.PARTLY if numbers.closure >= MOSTLY else Verdict.UNKNOWN

    def _closure(self, names: Names, gaps: list[RunGap], floor: float) -> float:
        """Return the closure of a set of effects over the sections judged on; not clipped at 0, so that shares add up."""
        before = np.concatenate([gap.section_gap(False) for gap in gaps])
        if not names:
            return 0.0
        model = self.found.tried[names].fitted.model
        after = np.concatenate([g.sections.planned_s(g.watched.plan(model)) - g.sections.recorded_s for g in gaps])
        reducible = _rms(before) ** 2 - floor**2
        return 1.0 - (_rms(after) ** 2 - floor**2) / reducible if reducible > 0.0 else 0.0

    def _causes(self, gaps: list[RunGap], floor: float, numbers: GapNumbers) -> tuple[Cause, ...]:
        """The effects of the answer, each with its Shapley share: the mean of what it closes over all orders of adding them."""
        chosen = self.found.chosen
        worth = {
            frozenset(part): self._closure(frozenset(part), gaps, floor)
            for count in range(len(chosen.names) + 1)
            for part in combinations(sorted(chosen.names), count)
        }
        shares = {name: _shapley(name, chosen.names, worth) for name in chosen.names}
        scale = numbers.closure / sum(shares.values()) if sum(shares.values()) > 0.0 else 0.0
        causes = [
            Cause(
                effect=name,
                on="",
                probability=self.found.probability[name],
                parameters=chosen.fitted.intervals(name),
                indistinguishable_from=tuple(Effected(other) for other in self.found.alike[name]),
                closure=share * scale,
            )
            for name, share in shares.items()
        ]
        return tuple(sorted(causes, key=lambda cause: -cause.closure))

    def _candidates(self, gaps: list[RunGap], floor: float) -> tuple[Candidate, ...]:
        tried = [
            Candidate(name, "", float(np.clip(self._closure(frozenset({name}), gaps, floor), 0.0, 1.0)), p)
            for name, p in self.found.p_alone.items()
        ]
        return tuple(sorted(tried, key=lambda one: -one.closure))

    def _not_identifiable(self) -> tuple[str, ...]:
        chosen = self.found.chosen
        return tuple(f"{name}.{p}" for name in sorted(chosen.names) for p in chosen.fitted.unknown(name))

    def _next(self) -> NextExperiment | None:
        """Return a program for what these could not tell."""
        chosen = self.found.chosen
        open_questions = [f"{name} from {other}" for name, others in self.found.alike.items() for other in others]
        if open_questions:
            why = f"tells {', '.join(open_questions)}: the same straight line in blocks of 0.2 mm and in one, no corner in either"
            return NextExperiment(why, STAIRS)
        if any(effect_named(e).excited_by is Excitation.TOOL_CHANGES for e in chosen.names if chosen.fitted.unknown(e)):
            return NextExperiment(
                "run-ups of the spindle to two speeds tell torque from power; tool changes without them", RUN_UPS
            )
        return None

    def _notes(self, gaps: list[RunGap]) -> tuple[str, ...]:
        notes = []
        model = self.found.chosen.fitted.model
        if any(trial.references for trial in self.trials.learnt):
            notes.append(
                f"the reference position of Z, which neither the machine nor the programs state, was taken to be "
                f"{model.reference_mm:.0f} mm above the zero of the work; G28 goes there"
            )
        if self._section_floor(gaps) == _recorder_s(gaps):
            notes.append("no program ran twice: the floor is what the recorder cannot tell, not what runs differ by")
        driven = _seconds_of_knobs(gaps)
        if driven >= 1.0:
            notes.append(
                f"recorded overrides make up {digits(driven)} s a run on the average; they are inputs and no part of the gap"
            )
        return tuple(notes)


def _seconds_of_knobs(gaps: Sequence[RunGap]) -> float:
    """Return the seconds that the recorded overrides change in a run, by the twin before."""
    apart = []
    for gap in gaps:
        feed, rapid = gap.watched.overrides
        if np.any(feed != 1.0) or np.any(rapid != 1.0):
            path = gap.before.path
            ideal = np.where(path.kind == Kind.RAPID, 1.0 / rapid - 1.0, 1.0 / feed - 1.0) * gap.before.duration_s
            apart.append(abs(float(np.sum(ideal * np.where(path.kind == Kind.RAPID, rapid, feed)))))
    return float(np.sum(apart) / len(gaps)) if apart else 0.0


def _recorder_s(gaps: Sequence[RunGap]) -> float:
    """Return the seconds of a section or a window that the recorder cannot tell."""
    return _rms(np.array([gap.floor_s for gap in gaps]))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _closures(before: Floats, after: Floats, floor: float, rng: np.random.Generator) -> Floats:
    """Closure with sections drawn again, (draws,)."""
    drawn = rng.integers(0, len(before), (DRAWS, len(before)))
    return np.array([closure_of(_rms(before[one]), _rms(after[one]), floor) for one in drawn])


def _shapley(name: str, names: Names, worth: Mapping[Names, float]) -> float:
    """Share of `name` in what `names` are worth (Shapley 1953)."""
    others, count = sorted(names - {name}), len(names)
    share = 0.0
    for size in range(count):
        weight = factorial(size) * factorial(count - size - 1) / factorial(count)
        for part in combinations(others, size):
            share += weight * (worth[frozenset(part) | {name}] - worth[frozenset(part)])
    return share


def _traces(gap: RunGap) -> tuple[Trace, ...]:
    """Active seconds at the lines of a run, recorded and by the twins, in windows of 10 s or more."""
    trial = gap.watched.trial
    long = Watched.of(trial, LONG_WINDOW_S)
    section = np.searchsorted(gap.sections.begin[:-1], long.begin + 1e-9, side="right") - 1
    return (
        Trace(
            run=trial.name,
            signal="program_time_s",
            unit="s",
            t_s=long.begin,
            measured=long.begin,
            before=long.planned_s(gap.before),
            after=long.planned_s(gap.after),
            floor=np.full(len(long.begin), gap.floor_s),
            regime=np.maximum(section, 0).astype(np.int8),
            regimes=gap.sections.names,
            fitted=trial.fitted,
        ),
    )


def _sentence(verdict: Verdict, gaps: Sequence[RunGap], causes: Sequence[Cause]) -> str:
    """The verdict in words: how far off programs are, why, and how far off they are with the causes."""
    off = [
        float(np.mean([abs(g.section_gap(after).sum()) / g.sections.recorded_s.sum() for g in gaps])) for after in (False, True)
    ]
    runs = f"{len(gaps)} runs" if len(gaps) > 1 else "the run"
    named = " and ".join(f"{c.effect} ({percent(c.closure)})" for c in causes)
    first = f"the twin's time is off by {100.0 * off[0]:.1f} % on {runs} it was not fitted to"
    match verdict:
        case Verdict.HEALTHY:
            return f"healthy: {first}, no more than what the recordings can tell"
        case Verdict.UNKNOWN:
            return f"{first}, and no effect of the control accounts for it"
        case Verdict.EXPLAINED:
            return f"{first}, because of {named}; with them by {100.0 * off[1]:.2f} %, which is what the recordings can tell"
    return f"{first}, mostly because of {named}; with them by {100.0 * off[1]:.1f} %, a remainder that has no name"
