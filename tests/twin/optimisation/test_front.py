"""The front of time and cost, beside an exhaustive search over all speeds."""

import numpy as np

from tests.twin.optimisation.benchmark import second
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


def test_the_chosen_program_of_the_front_is_the_one_that_is_written() -> None:
    question = second(objective=Objective.PARETO, evolutions=10, population=24, islands=1)
    first, last = (optimise(question.with_(pick=pick)) for pick in (0, None))
    assert first.front[0].chosen
    for answer in (first, last):
        chosen = next(point for point in answer.front if point.chosen)
        assert abs(answer.after.seconds / chosen.seconds - 1.0) < 1e-3
