"""The reference paper's benchmark, by reconstruction constants: its four results, and what its own search makes of it."""

import pytest

from tests.twin.optimisation.benchmark import paper
from twin.optimisation.answer import Objective
from twin.optimisation.optimise import optimise
from twin.optimisation.paper import paper_search
from twin.optimisation.question import problem


def test_the_program_takes_and_costs_what_the_paper_says() -> None:
    before = problem(paper(objective=Objective.COST)).as_programmed()
    assert before.seconds[0] == pytest.approx(29.48, abs=0.005)
    assert before.cost[0] == pytest.approx(120.1, abs=0.05)


@pytest.mark.parametrize("objective", [Objective.TIME, Objective.COST, Objective.PARETO])
def test_the_optimum_is_the_papers_and_no_load_is_above_60_n(objective: Objective) -> None:
    answer = optimise(paper(objective=objective, evolutions=10, islands=1))
    assert answer.after.seconds == pytest.approx(24.51, abs=0.005)
    assert answer.after.cost == pytest.approx(76.40, abs=0.03)
    assert 100.0 * (answer.after.seconds / answer.before.seconds - 1.0) == pytest.approx(-16.9, abs=0.05)
    assert 100.0 * (answer.after.cost / answer.before.cost - 1.0) == pytest.approx(-36.4, abs=0.05)
    assert answer.after.force_n <= 60.0
    assert answer.bound.exact
    assert answer.bound.distance < 1e-3
    changed = [line for line in answer.diff.splitlines() if line.startswith("+") and not line.startswith("+++")]
    assert changed == ["+S4584 M3", "+N10 G1 X5.800 F500"], "one word of speed and one of feed are the whole answer"


def test_time_and_cost_share_one_optimum_so_the_front_is_one_program() -> None:
    answer = optimise(paper(objective=Objective.PARETO, evolutions=10, islands=1))
    assert len(answer.front) == 1


@pytest.mark.parametrize(("objective", "least", "most"), [(Objective.TIME, 0.10, 0.40), (Objective.COST, 0.15, 0.45)])
def test_the_papers_own_search_ends_far_above_it(objective: Objective, least: float, most: float) -> None:
    found = [paper_search(paper(objective=objective, seed=seed)) for seed in range(4)]
    distances = sorted(one.distance for one in found)
    assert least < distances[1] < most
    assert all(one.evaluations == 64 + 10 * 56 for one in found)
