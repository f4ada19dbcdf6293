"""The front of time and cost, beside an exhaustive search over all speeds."""

import numpy as np
import pytest

from tests.twin.optimisation.benchmark import second
from twin.errors import OptimisationError
from twin.optimisation.answer import Objective
from twin.optimisation.front import hypervolume, not_dominated
from twin.optimisation.optimise import optimise
from twin.optimisation.question import problem

STEP_RPM = 200.0


def test_the_front_is_that_of_an_exhaustive_search() -> None:
    question = second(objective=Objective.PARETO, evolutions=40, population=40, islands=2)
    made = problem(question)
    grid = np.arange(3000.0, 8000.0 + 1.0, STEP_RPM)
    speeds = np.stack(np.meshgrid(grid, grid, grid, indexing="ij"), axis=-1).reshape(-1, 3)
    feeds = made.allowed.feed_max(speeds)
    every = np.column_stack(made.evaluate_words(feeds, speeds))
    best = every[not_dominated(every)]
    answer = optimise(question)
    found = np.array([[point.seconds, point.cost] for point in answer.front])
    assert len(found) > 20
    corner = every.max(axis=0)
    assert hypervolume(found, corner) >= 0.999 * hypervolume(best, corner)
    for seconds, cost in best:
        assert found[found[:, 0] <= seconds * 1.001, 1].min(initial=np.inf) <= cost * 1.01, "no point of the grid beats the front"
    assert found[:, 1].min() <= best[:, 1].min() * 1.0005
    assert found[:, 0].min() <= best[:, 0].min() * (1.0 + 1e-9)


def test_time_and_cost_disagree_there() -> None:
    fast = optimise(second(objective=Objective.TIME, evolutions=10, islands=1)).after
    cheap = optimise(second(objective=Objective.COST, evolutions=10, islands=1)).after
    assert fast.seconds < 0.9 * cheap.seconds
    assert cheap.cost is not None
    assert fast.cost is not None
    assert cheap.cost < 0.95 * fast.cost


def test_the_program_that_is_picked_is_the_one_of_that_number() -> None:
    question = second(objective=Objective.PARETO, evolutions=10, population=80, islands=2)
    whole = optimise(question)
    assert len(whole.front) == 60, "of more programs than a table holds, some"
    for pick in (0, 41, 59):
        answer = optimise(question.with_(pick=pick))
        assert [point.chosen for point in answer.front].index(True) == pick
        assert answer.after.seconds == pytest.approx(whole.front[pick].seconds, rel=1e-3)
        assert answer.after.cost == pytest.approx(whole.front[pick].cost, rel=1e-3)
    with pytest.raises(OptimisationError, match="--pick 60: the front has 60 programs, from 0 to 59"):
        optimise(question.with_(pick=60))
