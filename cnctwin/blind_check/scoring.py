"""Scores diagnoses against answers, as curves over the size of the effect.

An effect counts as named where effect and `on` are both right. The size of a case is that of its smallest effect in its largest
signal, over the healthy floor.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import cos, inf

import numpy as np

from cnctwin.blind_check.answer import Answer, Answered
from cnctwin.blind_check.given import Given, Named
from cnctwin.blind_check.question import Sort
from cnctwin.blind_check.rate import Rate, rate_of
from twin.gap.diagnosis import Verdict

BINS = ((0.0, 1.0), (1.0, 1.5), (1.5, 2.0), (2.0, 3.0), (3.0, 10.0), (10.0, inf))
JUDGED_FROM = 2.0
"""Size from which the targets hold."""


@dataclass(frozen=True, slots=True)
class Judged:
    """A case with its answer and what was given."""

    answer: Answer
    given: Given

    @property
    def truths(self) -> frozenset[Named]:
        """The effects of the machine."""
        return frozenset((effect.effect, effect.on) for effect in self.answer.effects)

    @property
    def names(self) -> frozenset[Named]:
        """The causes by name."""
        return frozenset(cause.named for cause in self.given.causes)

    @property
    def right(self) -> bool:
        """Named by name: all there are, and none besides."""
        return self.names == self.truths

    @property
    def in_class(self) -> bool:
        """Each effect is in a reported class, and each class has one of them."""
        return not self.wrong and all(any(truth in cause.reported for cause in self.given.causes) for truth in self.truths)

    @property
    def wrong(self) -> bool:
        """A cause is reported whose class holds no effect of the machine."""
        return any(not cause.reported & self.truths for cause in self.given.causes)

    @property
    def some(self) -> bool:
        """At least one effect is in a reported class."""
        return any(cause.reported & self.truths for cause in self.given.causes)

    @property
    def unknown(self) -> bool:
        """It is said that the cause is not known, and none is named."""
        return self.given.verdict is Verdict.UNKNOWN and not self.given.causes and not self.given.failed

    def covered(self) -> tuple[bool, ...]:
        """For each parameter of a rightly named single effect that is said to be identifiable: does its 90 % interval hold it?"""
        if not (self.answer.sort is Sort.SINGLE and self.right):
            return ()
        truth, cause = self.answer.effects[0], self.given.causes[0]
        known = [name for name in truth.exact if name in cause.intervals]
        known = [name for name in known if not any(name in sentence for sentence in self.given.not_identifiable)]
        return tuple(_within(truth, name, *cause.intervals[name]) for name in known)


def _within(truth: Answered, name: str, low: float, high: float) -> bool:
    value = truth.stated[name]
    if name == "phase_rad":
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        return half >= np.pi or cos(value - middle) >= cos(half)
    return low <= value <= high


@dataclass(frozen=True, slots=True)
class Scores:
    """The score of the cases of some sizes. closure: median share of the gap that is gone on runs never seen."""

    single_right: Rate
    single_in_class: Rate
    single_wrong: Rate
    outside_unknown: Rate
    outside_wrong: Rate
    pair_both: Rate
    pair_some: Rate
    pair_wrong: Rate
    triple_all: Rate
    closure: float
    closure_reached: Rate
    covered: Rate
    class_size: float


@dataclass(frozen=True, slots=True)
class Scored:
    """By size, from `JUDGED_FROM` on, and of the healthy ones; by effect: of single ones from there on."""

    by_size: Mapping[tuple[float, float], Scores]
    judged: Scores
    healthy: Rate
    healthy_wrong: Rate
    by_effect: Mapping[str, tuple[Rate, Rate]]
    failed: Rate
    seconds_median: float
    seconds_max: float


CLOSED = 0.95
"""Share of what the true effect closes that has to be reached."""


def scores(cases: Sequence[Judged]) -> Scores:
    """The scores of these cases."""

    def of(sort: Sort) -> list[Judged]:
        return [case for case in cases if case.answer.sort is sort]

    single, pair, outside, triple = of(Sort.SINGLE), of(Sort.PAIR), of(Sort.OUTSIDE), of(Sort.TRIPLE)
    closed = [case.given.closure_unseen for case in single if case.given.closure_unseen is not None]
    sizes = [len(cause.reported) for case in single for cause in case.given.causes]
    return Scores(
        single_right=rate_of(case.right for case in single),
        single_in_class=rate_of(case.in_class for case in single),
        single_wrong=rate_of(case.wrong for case in single),
        outside_unknown=rate_of(case.unknown for case in outside),
        outside_wrong=rate_of(bool(case.given.causes) for case in outside),
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
        rate_of(case.given.verdict is Verdict.HEALTHY for case in healthy),
        rate_of(bool(case.given.causes) for case in healthy),
        by_effect,
        rate_of(bool(case.given.failed) for case in cases),
        float(np.median(seconds)),
        float(np.max(seconds)),
    )
