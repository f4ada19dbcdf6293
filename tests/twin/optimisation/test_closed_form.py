"""The best of each line by itself: never worse than anything that a fine grid finds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.depth import examples
from tests.twin.optimisation.benchmark import machine_with, paper, second, text
from twin.optimisation.answer import Objective
from twin.optimisation.question import Question, problem
from twin.optimisation.seeds import closed_form, worth_of

LIMITS = [
    {},
    {"power_kw": 0.25},
    {"torque_nm": 0.05},
    {"chip_mm": [0.005, 0.03]},
    {"surface_speed_m_min": [40.0, 120.0]},
    {"force_n": None},
]


def grid_best(question: Question, objective: Objective, line: int) -> tuple[float, float]:
    """Worth of the closed form, and the best of a grid of speeds and feeds."""
    made = problem(question)
    feed, rpm = closed_form(made, objective)
    worth = worth_of(made, objective)
    row = np.array([line])
    own = float(worth.of(row, feed[row], rpm[line]))
    speeds = np.concatenate([np.linspace(a, b, 400) for a, b in made.allowed.spans[line]])
    one = made.allowed.line(line)
    most = one.feed_max(speeds[:, None])[:, 0]
    best = min(float(worth.of(row, most[:, None] * part, speeds).min()) for part in (1.0, 0.9, 0.5))
    return own, best


@pytest.mark.parametrize("limits", LIMITS, ids=lambda limits: next(iter(limits), "force"))
@pytest.mark.parametrize("objective", [Objective.TIME, Objective.COST])
def test_no_speed_of_a_grid_is_better(limits: dict[str, object], objective: Objective) -> None:
    question = second(machine_toml=machine_with(text("second.toml"), limits=limits))
    for line in range(len(problem(question).allowed)):
        own, best = grid_best(question, objective, line)
        assert own <= best * (1.0 + 1e-9)


@settings(max_examples=examples(30), deadline=None)
@given(
    st.floats(200.0, 900.0),
    st.floats(0.12, 0.5),
    st.floats(0.0, 1e5),
    st.floats(10.0, 200.0),
    st.sampled_from(["in_cut", "in_program"]),
)
def test_whatever_a_tool_costs_no_speed_is_better(
    taylor_c: float, taylor_n: float, price: float, force_n: float, wears: str
) -> None:
    cost = {"taylor_c_m_per_min": taylor_c, "taylor_n": taylor_n, "tool_price": price, "tool_wears": wears}
    question = paper(machine_toml=machine_with(text("paper.toml"), cost=cost), force_limit_n=force_n, objective=Objective.COST)
    own, best = grid_best(question, Objective.COST, 3)
    assert own <= best * (1.0 + 1e-9)


def test_by_hand_the_corner_of_force_and_feed() -> None:
    """60 N of a slot 0.8 mm deep are 1230 · 0.8 · c · √1.25: c = 54.54 µm, and 500 mm/min at two teeth 4583.9 rev/min."""
    feed, rpm = closed_form(problem(paper(objective=Objective.COST)), Objective.COST)
    assert feed == pytest.approx(np.full(10, 500.0))
    assert rpm == pytest.approx(np.full(10, 500.0 / (2 * 60.0 / (1230.0 * 0.8 * 1.25**0.5))), rel=1e-9)
