"""What feed and block say, weighed."""

import numpy as np
import pytest

from twin.transient.evidence import longest, probability, run_length, weighing_of

NAMES = ("correlation", "rest")


def example() -> tuple[np.ndarray, np.ndarray]:  # type: ignore[type-arg]
    rng = np.random.default_rng(0)
    rows = [(rng.normal(0.9, 0.05), np.log(rng.uniform(3.5, 4.5))) for _ in range(12)]
    rows += [(rng.normal(0.5, 0.2), np.log(rng.uniform(0.3, 2.0))) for _ in range(20)]
    return np.array(rows), np.array([True] * 12 + [False] * 20)


def test_changes_are_told_from_the_rest() -> None:
    rows, is_change = example()
    weighing = weighing_of(NAMES, (False, True), rows, is_change)
    odds = np.array([weighing.logit(row) for row in rows])
    assert np.all((odds > 0.0) == is_change)
    assert min(weighing.weights) >= 0.0


def test_a_rest_that_is_far_too_long_speaks_against_a_change_as_one_that_is_too_short() -> None:
    weighing = weighing_of(NAMES, (False, True), *example())
    typical, short, long = (weighing.logit((0.9, np.log(seconds))) for seconds in (4.0, 0.5, 32.0))
    assert typical > 0.0 and typical > short and long < -2.0
    assert weighing.logit((0.9, np.log(5.5))) == pytest.approx(typical), "half as slow again is still the same machine"


def test_a_feature_that_says_the_contrary_by_chance_is_left_out() -> None:
    rows, is_change = example()
    rows[:, 0] = -rows[:, 0]
    assert weighing_of(NAMES, (False, True), rows, is_change).weights[0] == 0.0


def test_the_longest_rest_in_a_window_is_no_longer_than_the_window() -> None:
    lengths = np.array([50.0, 51.0, 52.0, 0.0, 1.0, 2.0])
    assert longest(lengths, 1.0) == pytest.approx(np.log(3.0))
    assert longest(np.array([1.0, 2.0, -1.0]), 1.0) is None
    assert longest(np.array([-1.0, -1.0, 1.0, 2.0]), 1.0) == pytest.approx(np.log(2.0))


def test_odds_become_a_probability() -> None:
    assert probability(0.0) == 0.5
    assert probability(1000.0) == pytest.approx(1.0) and probability(-1000.0) == pytest.approx(0.0)


def test_run_lengths_say_when_they_are_not_known() -> None:
    length = -1.0
    seen = []
    for holds in (True, True, False, True, None, True):
        length = run_length(length, holds)
        seen.append(length)
    assert seen == [1.0, 2.0, 0.0, 1.0, -1.0, 1.0]
