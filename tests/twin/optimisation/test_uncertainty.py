"""A limit that is kept with a probability, and feeds on a twin whose force is higher."""

from pathlib import Path

import numpy as np
import pytest

from tests.twin.optimisation.benchmark import machine_with, paper, second, text
from twin.optimisation.answer import Objective
from twin.optimisation.optimise import optimise
from twin.optimisation.question import Question

NOTEBOOKS = Path(__file__).parents[3] / "docs/notebooks"
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


def test_with_the_constants_as_stated_it_is_a_coin_toss_and_that_is_said() -> None:
    answer = optimise(paper(objective=Objective.COST, **SHORT))
    assert answer.sensitivity is not None
    assert answer.sensitivity.kept == pytest.approx(0.5, abs=0.05)
    assert answer.sensitivity.is_unsure
    kept = f"kept with {100 * answer.sensitivity.kept:.0f} % probability"
    assert f"60.0 N of 60 N, {kept}{'' if answer.sensitivity.identified else ' (nothing identified)'}; " in answer.sentence


def test_the_price_of_a_probability_is_the_difference_of_the_two_answers() -> None:
    """The spindle turns slower for the sake of its run-up, which the closed form of a line does not see."""
    program, machine = ((NOTEBOOKS / name).read_text() for name in ("pocket.nc", "vmc.toml"))
    machine = machine_with(machine, limits={"chip_mm": None})
    stated, surely = (
        optimise(Question(program, machine, force_limit_n=300.0, probability=asked), resimulate=False) for asked in (None, 0.95)
    )
    assert stated.sensitivity is not None and surely.sensitivity is not None
    price = 100.0 * (surely.after.seconds / stated.after.seconds - 1.0)
    assert price > 1.0
    assert stated.sensitivity.price_pct == pytest.approx(price, abs=0.1)
    assert surely.sensitivity.price_pct == pytest.approx(price, abs=0.1)


def test_what_is_kept_surely_already_costs_nothing() -> None:
    answer = optimise(paper(objective=Objective.COST, force_limit_n=5000.0, **SHORT))
    assert answer.sensitivity is not None
    assert (answer.sensitivity.kept, answer.sensitivity.price_pct) == (1.0, 0.0)
    assert "probability" not in answer.sentence


def test_a_line_that_waits_for_the_spindle_says_so_and_no_other() -> None:
    program, machine = ((NOTEBOOKS / name).read_text() for name in ("pocket.nc", "vmc.toml"))
    quick = machine_with(machine, program={"spindle_acceleration_rpm_s": None})
    waits, does_not = (
        [line.binds for line in optimise(Question(program, toml, force_limit_n=200.0, **SHORT), resimulate=False).lines]
        for toml in (machine, quick)
    )
    assert waits[0].endswith("and spindle run-up") and "axis dynamics" not in waits[0]
    assert "spindle run-up" not in " ".join([waits[1], *does_not])


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
