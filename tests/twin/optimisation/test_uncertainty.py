"""A limit that is kept with a probability, and feeds on a twin whose force is higher."""

import numpy as np
import pytest

from tests.twin.optimisation.benchmark import machine_with, paper, second, text
from twin.optimisation.answer import Objective
from twin.optimisation.optimise import optimise
from twin.optimisation.question import Question

SHORT = {"evolutions": 10, "islands": 1, "population": 16}
EDGE = {"effect": "edge_force", "on": "", "parameters": {"tangential_n_per_mm": 8.0, "radial_n_per_mm": 12.0}}


def with_uncertainty(**uncertainty: float) -> str:
    return machine_with(text("paper.toml"), uncertainty=uncertainty)


@pytest.mark.parametrize("probability", [0.8, 0.95, 0.99])
def test_the_limit_is_kept_with_the_probability_that_was_asked_for(probability: float) -> None:
    answer = optimise(paper(objective=Objective.COST, probability=probability, **SHORT))
    assert answer.sensitivity is not None
    spread = np.sqrt(probability * (1.0 - probability) / answer.sensitivity.draws)
    assert answer.sensitivity.kept == pytest.approx(probability, abs=4.0 * spread + 0.005)
    assert answer.sensitivity.price_pct > 0.0
    assert answer.after.force_n < 60.0


def test_by_the_mean_twin_it_is_a_coin_toss_and_that_is_said() -> None:
    answer = optimise(paper(objective=Objective.COST, **SHORT))
    assert answer.sensitivity is not None
    assert answer.sensitivity.kept == pytest.approx(0.5, abs=0.05)


def test_the_better_a_constant_is_known_the_closer_the_limit_may_be() -> None:
    forces = []
    for known in (0.10, 0.02):
        path = {"tool.tangential_coefficient_n_per_mm2": known, "relative": 0.01}
        answer = optimise(paper(machine_toml=with_uncertainty(**path), objective=Objective.COST, probability=0.95, **SHORT))
        assert answer.sensitivity is not None
        assert answer.sensitivity.parts[0].path == "tool.tangential_coefficient_n_per_mm2"
        forces.append(answer.after.force_n)
    assert forces[0] < forces[1] < 60.0


def test_a_machine_that_is_known_exactly_has_nothing_to_say() -> None:
    assert optimise(paper(machine_toml=with_uncertainty(relative=0.0), **SHORT)).sensitivity is None


def test_where_the_diagnosis_says_that_the_force_is_higher_feeds_are_lower_and_elsewhere_not() -> None:
    """The uncorrected twin would break the limit on the machine that the corrected one describes."""
    corrected = machine_with(text("second.toml"), effects=[EDGE])
    answers = [optimise(second(machine_toml=toml, **SHORT)) for toml in (text("second.toml"), corrected)]
    feeds = np.array([[line.after.feed_mm_min for line in answer.lines] for answer in answers])
    assert (feeds[1] < 0.93 * feeds[0]).all()
    assert feeds[1, 2] < 0.75 * feeds[0, 2], "most where the cut is deepest and the edge longest"
    assert max(answer.after.force_n for answer in answers) <= 60.0
    blind = Question(answers[0].program, corrected, name="what the uncorrected twin chose")
    assert optimise(blind.with_(**SHORT)).before.force_n > 70.0
    easy = [optimise(second(machine_toml=toml, force_limit_n=1000.0, **SHORT)) for toml in (text("second.toml"), corrected)]
    first, other = ([line.after.feed_mm_min for line in answer.lines] for answer in easy)
    assert first == pytest.approx(other, rel=0.01)
