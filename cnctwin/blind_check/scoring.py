"""Scores diagnoses against answers, as curves over the size of the effect.

An effect counts as named where effect and `on` are both right. The size of a case is that of its smallest effect in its largest
signal, over the healthy floor.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import cos, inf

import numpy as np

from cnctwin.blind_check.answer import Answer, Answered
from cnctwin.blind_check.given import Given, GivenTerm, Named
from cnctwin.blind_check.question import Sort
from cnctwin.blind_check.rate import Rate, rate_of
from twin.gap.diagnosis import Verdict

BINS = ((0.0, 1.0), (1.0, 1.5), (1.5, 2.0), (2.0, 3.0), (3.0, 10.0), (10.0, inf))
JUDGED_FROM = 2.0
"""Size from which the targets hold."""
CLOSED = 0.95
"""Share of what the true effect closes that has to be reached."""


@dataclass(frozen=True, slots=True)
class Judged:
    """A case with its answer and what was given."""

    answer: Answer
    given: Given

    @property
    def truths(self) -> frozenset[Named]:
        """The effects of the machine that are asked."""
        return frozenset((effect.effect, effect.on) for effect in self.answer.effects)

    @property
    def structure(self) -> frozenset[Named]:
        """The structure of a controller that is not the stated one, which may be named or not; none as a rule."""
        controller = self.answer.controller
        return frozenset() if controller is None else frozenset({(controller.effect, controller.on)})

    @property
    def controller_shows(self) -> bool:
        """True where another structure of a controller is a gap of the judged size by itself."""
        return self.answer.controller is not None and self.answer.controller.size >= JUDGED_FROM

    @property
    def controller_told(self) -> bool:
        """True where another structure of a controller is named, or its subsystem called not understood; or none shows."""
        doubtful = (Verdict.UNKNOWN, Verdict.PARTLY)
        return not self.controller_shows or all(
            any(truth in cause.reported for cause in self.given.causes)
            or self.given.subsystems.get(f"{truth[1]} controller") in doubtful
            for truth in self.structure
        )

    @property
    def names(self) -> frozenset[Named]:
        """The causes by name, but for those whose class has the structure of a controller."""
        return frozenset(cause.named for cause in self.given.causes if not cause.reported & self.structure)

    @property
    def right(self) -> bool:
        """Named by name: all there are, and none besides."""
        return self.names == self.truths and self.controller_told

    @property
    def in_class(self) -> bool:
        """Each effect is in a reported class, and each class has one of them."""
        found = all(any(truth in cause.reported for cause in self.given.causes) for truth in self.truths)
        return found and not self.wrong and self.controller_told

    @property
    def wrong(self) -> bool:
        """A cause is reported whose class holds no effect of the machine."""
        return any(not cause.reported & (self.truths | self.structure) for cause in self.given.causes)

    @property
    def some(self) -> bool:
        """At least one effect is in a reported class."""
        return any(cause.reported & self.truths for cause in self.given.causes)

    @property
    def unknown(self) -> bool:
        """It is said that the cause is not known, or it is described, and none is named but the structure of a controller."""
        without = (Verdict.UNKNOWN, Verdict.PARTLY) if self.structure else (Verdict.UNKNOWN,)
        said = self.given.verdict in without or bool(self.given.learned)
        return said and not self.names and not self.given.failed

    @property
    def taken_up(self) -> bool:
        """The constants have taken the effect up, runs never seen included, and it is said which of them moved."""
        closed = self.given.closure_unseen is not None and self.given.closure_unseen >= CLOSED
        return closed and bool(self.given.constants) and not (self.names or self.unknown or self.given.failed)

    @property
    def missed(self) -> bool:
        """It is there, and nothing is said of it."""
        return not (self.names or self.unknown or self.taken_up)

    @property
    def described(self) -> tuple[GivenTerm, ...]:
        """The learned terms, but for those that describe the other structure of a controller."""
        of_structure = {on for _, on in self.structure}
        return tuple(t for t in self.given.learned if not (t.site == "controller" and t.on in of_structure))

    @property
    def site_right(self) -> bool:
        """The learned term that closes most acts where one of the effects does."""
        return any(_acts_at(effect, term) for effect in self.answer.effects for term in self.described[:1])

    @property
    def variables_right(self) -> bool:
        """It depends on what the effect depends on as well."""
        return any(
            term.depends_on == one.depends_on and term.site == one.site and _acts_at(effect, term)
            for effect in self.answer.effects
            for one in effect.acts_at
            for term in self.described[:1]
        )

    def covered(self) -> tuple[bool, ...]:
        """For each parameter of a rightly named single effect that is said to be identifiable: does its 90 % interval hold it?"""
        if not (self.answer.sort is Sort.SINGLE and self.right):
            return ()
        truth = self.answer.effects[0]
        cause = next(cause for cause in self.given.causes if cause.named == (truth.effect, truth.on))
        known = [name for name in truth.exact if name in cause.intervals]
        known = [name for name in known if not any(name in sentence for sentence in self.given.not_identifiable)]
        return tuple(_within(truth, name, *cause.intervals[name]) for name in known)


def _acts_at(effect: Answered, term: GivenTerm) -> bool:
    """Tell whether a term is at a site of the effect, and on its axis; `on` may be a column of that axis."""
    return any(term.site == one.site for one in effect.acts_at) and term.on[: len(effect.on)] == effect.on


def _within(truth: Answered, name: str, low: float, high: float) -> bool:
    value = truth.stated[name]
    if name == "phase_rad":
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        return half >= np.pi or cos(value - middle) >= cos(half)
    return low <= value <= high


@dataclass(frozen=True, slots=True)
class LearnedScores:
    """The learned terms of cases that were called outside the catalogue; of each the term that closes most.

    site: acts where the effect does; variables: depends on what it does, where the site is right; closure: median on unseen runs
    """

    site: Rate
    variables: Rate
    closure: float


@dataclass(frozen=True, slots=True)
class Scores:
    """The score of the cases of some sizes. closure: median share of the gap that is gone on runs never seen.

    outside_told: called unknown, or taken up by the constants, and said so
    """

    single_right: Rate
    single_in_class: Rate
    single_wrong: Rate
    outside_unknown: Rate
    outside_taken_up: Rate
    outside_told: Rate
    outside_missed: Rate
    outside_wrong: Rate
    pair_both: Rate
    pair_some: Rate
    pair_wrong: Rate
    triple_all: Rate
    closure: float
    closure_reached: Rate
    covered: Rate
    class_size: float


def closures(cases: Iterable[Judged]) -> list[float]:
    """The shares of the gap that are gone on runs never seen, where there is something to close."""
    return [case.given.closure_unseen for case in cases if case.given.closure_unseen is not None]


@dataclass(frozen=True, slots=True)
class Scored:
    """The scores by size, from `JUDGED_FROM` on, and of the healthy ones; by effect: of single ones from there on.

    nominal, other_controller: as `judged`, of machines with the controller that they state, and of those with another one
    controller_told: of those where it shows by itself, the ones where it is named, or called not understood
    """

    by_size: Mapping[tuple[float, float], Scores]
    judged: Scores
    nominal: Scores
    other_controller: Scores
    controller_told: Rate
    learned: LearnedScores
    healthy: Rate
    healthy_wrong: Rate
    by_effect: Mapping[str, tuple[Rate, Rate]]
    failed: Rate
    seconds_median: float
    seconds_max: float


def learned_scores(cases: Sequence[Judged]) -> LearnedScores:
    """The scores of the learned terms of these cases; one without a term is wrong. Closure is of stated controllers."""
    closed = closures(case for case in cases if not case.structure)
    return LearnedScores(
        rate_of(case.site_right for case in cases),
        rate_of(case.variables_right for case in cases),
        float(np.median(closed)) if closed else float("nan"),
    )


def scores(cases: Sequence[Judged]) -> Scores:
    """The scores of these cases."""

    def of(sort: Sort) -> list[Judged]:
        return [case for case in cases if case.answer.sort is sort]

    single, pair, outside, triple = of(Sort.SINGLE), of(Sort.PAIR), of(Sort.OUTSIDE), of(Sort.TRIPLE)
    closed = closures(case for case in single if not case.structure)
    sizes = [len(cause.reported) for case in single for cause in case.given.causes]
    return Scores(
        single_right=rate_of(case.right for case in single),
        single_in_class=rate_of(case.in_class for case in single),
        single_wrong=rate_of(case.wrong for case in single),
        outside_unknown=rate_of(case.unknown for case in outside),
        outside_taken_up=rate_of(case.taken_up for case in outside),
        outside_told=rate_of(case.unknown or case.taken_up for case in outside),
        outside_missed=rate_of(case.missed for case in outside),
        outside_wrong=rate_of(bool(case.names) for case in outside),
        pair_both=rate_of(case.in_class for case in pair),
        pair_some=rate_of(case.some for case in pair),
        pair_wrong=rate_of(case.wrong for case in pair),
        triple_all=rate_of(case.in_class for case in triple),
        closure=float(np.median(closed)) if closed else float("nan"),
        closure_reached=rate_of(value >= CLOSED for value in closed),
        covered=rate_of(held for case in single for held in case.covered()),
        class_size=float(np.mean(sizes)) if sizes else float("nan"),
    )


def scored(cases: Sequence[Judged]) -> Scored:
    """The whole check."""
    sick = [case for case in cases if case.answer.sort is not Sort.HEALTHY]
    healthy = [case for case in cases if case.answer.sort is Sort.HEALTHY]
    seen = [case for case in sick if case.answer.size >= JUDGED_FROM]
    seconds = [case.given.seconds for case in cases] or [0.0]
    single = [case for case in seen if case.answer.sort is Sort.SINGLE]
    effects = sorted({case.answer.effects[0].effect for case in single})
    by_effect = {
        name: (
            rate_of(case.right for case in single if case.answer.effects[0].effect == name),
            rate_of(case.in_class for case in single if case.answer.effects[0].effect == name),
        )
        for name in effects
    }
    return Scored(
        {(low, high): scores([case for case in sick if low <= case.answer.size < high]) for low, high in BINS},
        scores(seen),
        scores([case for case in seen if not case.structure]),
        scores(other := [case for case in seen if case.structure]),
        rate_of(case.controller_told for case in other if case.controller_shows),
        learned_scores([case for case in seen if case.answer.sort is Sort.OUTSIDE and case.unknown]),
        rate_of(case.given.verdict is Verdict.HEALTHY for case in healthy),
        rate_of(bool(case.given.causes) for case in healthy),
        by_effect,
        rate_of(bool(case.given.failed) for case in cases),
        float(np.median(seconds)),
        float(np.max(seconds)),
    )
