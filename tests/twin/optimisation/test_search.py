"""The search: the same seed takes the same course, stopped or not, wherever its pieces are worked out."""

import json
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.depth import examples
from tests.twin.optimisation.benchmark import second
from twin.errors import OptimisationError
from twin.motion.candidates import Candidates
from twin.optimisation.answer import Objective
from twin.optimisation.bound import bound_of
from twin.optimisation.islands import fitness_of
from twin.optimisation.optimise import Hooks, Stopped, optimise
from twin.optimisation.question import Question, problem
from twin.optimisation.rewriting import rewritten
from twin.optimisation.seeds import seeds

SHORT = {"evolutions": 20, "population": 16, "islands": 2}


def plain(question: Question, hooks: Hooks | None = None, checkpoint: str | None = None) -> dict[str, object]:
    """The answer without how long it took."""
    answer = optimise(question, hooks or Hooks(), checkpoint).as_json()
    answer["search"].pop("seconds")
    return answer


@pytest.mark.parametrize("objective", [Objective.COST, Objective.PARETO])
def test_a_search_that_was_stopped_ends_where_it_would_have_ended(objective: Objective) -> None:
    question, kept = second(objective=objective, **SHORT), []
    whole = plain(question)
    with pytest.raises(Stopped):
        plain(question, Hooks(save=kept.append, stop=lambda: bool(kept)))
    assert json.loads(kept[-1])["done"] == 10
    assert plain(question, checkpoint=kept[-1]) == whole


def test_a_checkpoint_of_another_question_is_passed_over() -> None:
    kept: list[str] = []
    plain(second(**SHORT), Hooks(save=kept.append))
    other = second(seed=2, **SHORT)
    assert plain(other, checkpoint=kept[-1]) == plain(other)


def test_who_works_the_islands_out_makes_no_difference() -> None:
    question = second(objective=Objective.COST, **SHORT)

    def beside_each_other(function: Callable[[str], str], texts: Sequence[str]) -> Iterable[str]:
        with ThreadPoolExecutor(2) as pool:
            return list(pool.map(function, texts))

    assert plain(question, Hooks(spread=beside_each_other)) == plain(question)


def test_no_search_ends_worse_than_it_began() -> None:
    made = problem(second(objective=Objective.COST))
    fitness = fitness_of(made, Objective.COST)
    answer = optimise(second(objective=Objective.COST, **SHORT))
    assert answer.search.history == tuple(sorted(answer.search.history, reverse=True))
    assert answer.search.history[-1] <= float(fitness(seeds(made, Objective.COST)).min())
    assert answer.after.cost == pytest.approx(answer.search.history[-1], rel=1e-3)


@settings(max_examples=examples(20), deadline=None)
@given(st.integers(0, 2**32))
def test_what_the_batch_says_of_a_candidate_is_what_the_rewritten_program_takes(seed: int) -> None:
    """The batch knows the program with optional changes of speed; the text has words. Both go through the same control."""
    made = problem(second())
    chance = np.random.default_rng(seed)
    feed, rpm = made.decoded(chance.random((1, made.genes)))
    words = np.floor(feed[0]), np.floor(rpm[0])
    if chance.random() < 0.3:
        words[1][1:] = words[1][0]
    text = rewritten(made, *words)
    assert text.not_followed == {}
    seconds, cost = made.evaluate_words(words[0][None], words[1][None])
    assert made.evaluate_path(text.path) == (pytest.approx(seconds[0], rel=1e-9), pytest.approx(cost[0], rel=1e-9))
    assert made.control.plan(text.path).total_s == pytest.approx(seconds[0], rel=1e-9)


@pytest.mark.parametrize("objective", [Objective.TIME, Objective.COST])
@settings(max_examples=examples(20), deadline=None)
@given(st.integers(0, 2**32))
def test_no_candidate_is_below_the_bound(objective: Objective, seed: int) -> None:
    made = problem(second(objective=objective))
    genes = np.random.default_rng(seed).random((64, made.genes))
    genes[:32, : len(made.allowed)] = 1.0
    seconds, cost = made.evaluate(genes)
    values = seconds if objective is Objective.TIME else cost
    assert bound_of(made, objective, float(values.min())).value <= values.min() * (1.0 + 1e-9)


def test_a_change_to_the_speed_in_force_is_none() -> None:
    made = problem(second())
    candidates = made.speeds.candidates
    assert isinstance(candidates, Candidates)
    assert candidates.is_optional.sum() == 3
    same, other = (
        made.evaluate_words(np.full((1, 3), 400.0), np.array([speeds])).seconds[0] for speeds in ([8e3] * 3, [8e3, 7e3, 8e3])
    )
    assert same == pytest.approx(made.as_programmed().seconds[0], rel=1e-12)
    assert other > same


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"population": 5}, "population is 5; it has to be even"),
        ({"evolutions": -1}, "evolutions is -1"),
        ({"islands": 0}, "islands is 0"),
        ({"force_limit_n": 0.0}, "the force limit is 0.0 N"),
        ({"probability": 0.2}, "the probability is 0.2"),
    ],
)
def test_a_question_that_cannot_be_put_is_refused(changes: dict[str, object], says: str) -> None:
    with pytest.raises(OptimisationError, match=says):
        second(**changes)


def test_a_question_comes_back_from_its_text() -> None:
    question = second(objective=Objective.PARETO, planned={3: [[1.0, 0.0, 3.0]]}, left_alone={4: "so"}, probability=0.9)
    assert Question.from_json(question.to_json()) == question
    assert Question.from_json(question.to_json()).digest() == question.digest()
