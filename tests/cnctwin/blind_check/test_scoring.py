"""Scores of diagnoses that are known to be right or wrong."""

from collections.abc import Sequence

import pytest

from cnctwin.blind_check.answer import Answer, Answered
from cnctwin.blind_check.given import Given, GivenCause, Named
from cnctwin.blind_check.question import Sort
from cnctwin.blind_check.rate import Rate
from cnctwin.blind_check.scoring import Judged, scored
from twin.gap.diagnosis import Verdict

GRAVITY, FRICTION = ("gravity", "z"), ("direction_friction", "z")


def case(
    sort: Sort, truths: Sequence[Named], causes: Sequence[GivenCause], verdict: Verdict = Verdict.EXPLAINED, size: float = 5.0
) -> Judged:
    effects = tuple(
        Answered(name, on, sort is not Sort.OUTSIDE, {"force_n": 300.0}, ("force_n",), {"s": size}) for name, on in truths
    )
    return Judged(Answer("case", sort, effects, {"s": size}), Given(verdict, tuple(causes), (), 1.0))


def cause(named: Named, *alike: Named, low: float = 290.0, high: float = 310.0) -> GivenCause:
    return GivenCause(named, frozenset(alike), {"force_n": (low, high)})


@pytest.mark.parametrize(
    ("causes", "right", "in_class", "wrong"),
    [
        ([cause(GRAVITY)], True, True, False),
        ([cause(FRICTION, GRAVITY)], False, True, False),
        ([cause(FRICTION)], False, False, True),
        ([cause(("gravity", "x"))], False, False, True),
        ([cause(GRAVITY), cause(("payload", "z"))], False, False, True),
        ([], False, False, False),
    ],
)
def test_a_name_counts_with_its_axis_and_nothing_besides(
    causes: list[GivenCause], right: bool, in_class: bool, wrong: bool
) -> None:
    one = case(Sort.SINGLE, [GRAVITY], causes)
    assert (one.right, one.in_class, one.wrong) == (right, in_class, wrong)


def test_an_effect_outside_the_catalogue_is_right_when_it_is_unknown() -> None:
    unknown = case(Sort.OUTSIDE, [("cable_chain", "x")], [], Verdict.UNKNOWN)
    named = case(Sort.OUTSIDE, [("cable_chain", "x")], [cause(GRAVITY)], Verdict.PARTLY)
    missed = case(Sort.OUTSIDE, [("cable_chain", "x")], [], Verdict.HEALTHY)
    found = scored([unknown, named, missed]).judged
    assert (found.outside_unknown.hits, found.outside_wrong.hits, found.outside_wrong.count) == (1, 1, 3)


def test_cases_fall_into_bins_by_their_smallest_effect() -> None:
    small, large = case(Sort.SINGLE, [GRAVITY], [], size=1.2), case(Sort.SINGLE, [GRAVITY], [cause(GRAVITY)], size=50.0)
    found = scored([small, large])
    assert found.by_size[1.0, 1.5].single_right.count == 1
    assert found.judged.single_right == Rate(1, 1)
    assert found.by_effect == {"gravity": (Rate(1, 1), Rate(1, 1))}


def test_a_pair_is_right_when_both_are() -> None:
    both = case(Sort.PAIR, [GRAVITY, ("backlash", "x")], [cause(GRAVITY), cause(("backlash", "x"))])
    half = case(Sort.PAIR, [GRAVITY, ("backlash", "x")], [cause(GRAVITY)])
    found = scored([both, half]).judged
    assert (found.pair_both, found.pair_some, found.pair_wrong) == (Rate(1, 2), Rate(2, 2), Rate(0, 2))


def test_healthy_is_healthy_and_names_nothing() -> None:
    found = scored([case(Sort.HEALTHY, [], [], Verdict.HEALTHY), case(Sort.HEALTHY, [], [cause(GRAVITY)])])
    assert (found.healthy, found.healthy_wrong) == (Rate(1, 2), Rate(1, 2))


def test_intervals_of_right_names_cover_or_not() -> None:
    cases = [
        case(Sort.SINGLE, [GRAVITY], [cause(GRAVITY)]),
        case(Sort.SINGLE, [GRAVITY], [cause(GRAVITY, low=310.0, high=320.0)]),
    ]
    assert scored(cases).judged.covered == Rate(1, 2)


def test_an_exact_interval_is_that_of_clopper_and_pearson() -> None:
    assert Rate(0, 10).high == pytest.approx(1.0 - 0.025**0.1)
    assert Rate(10, 10).low == pytest.approx(0.025**0.1)
    assert (Rate(0, 10).low, Rate(10, 10).high) == (0.0, 1.0)
    assert str(Rate(0, 0)) == "–"
