"""Limits: whatever candidate is drawn keeps all of them, and a program that cannot keep them is refused in one line."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.depth import examples
from tests.twin.optimisation.benchmark import machine_with, second, text
from twin.errors import MachineError, OptimisationError
from twin.optimisation.answer import Objective
from twin.optimisation.forces import CutForces, advance_at
from twin.optimisation.optimise import optimise
from twin.optimisation.paper import forces_of_lines
from twin.optimisation.question import Question, problem

EDGE = [{"effect": "edge_force", "on": "", "parameters": {"tangential_n_per_mm": 8.0, "radial_n_per_mm": 12.0}}]
SIZE = [{"effect": "size_effect", "on": "", "parameters": {"exponent": 0.3}}]
LEARNED = [
    {"effect": "learned", "site": "cut_force", "table": {"chip_mm": [0.0, 0.01, 0.04], "value": [900.0, 400.0, -200.0]}},
    {"effect": "learned", "site": "cut_force", "on": "x", "table": {"x_position_mm": [0.0, 9.0], "value": [-3.0, 2.0]}},
    {"effect": "learned", "site": "spindle_power", "table": {"load_pct": [0.0, 20.0, 30.0], "value": [0.01, 0.03, 0.02]}},
]
ALL = {"power_kw": 0.2, "torque_nm": 0.08, "chip_mm": [0.002, 0.05], "surface_speed_m_min": [30.0, 140.0]}
SPINDLE = {"rated_power_kw": 1.0, "efficiency": 0.8, "idle_power_kw": 0.1}


def limited(effects: object = (), limits: object = ALL) -> Question:
    return second(machine_toml=machine_with(text("second.toml"), limits=limits, spindle=SPINDLE, effects=effects))


@pytest.mark.parametrize("effects", [(), EDGE, SIZE, LEARNED], ids=["nominal", "edge force", "size effect", "learned"])
@settings(max_examples=examples(20), deadline=None)
@given(st.integers(0, 2**32))
def test_every_candidate_keeps_every_limit(effects: object, seed: int) -> None:
    made = problem(limited(effects))
    genes = np.random.default_rng(seed).random((8, made.genes))
    feed, rpm = made.decoded(genes)
    forces = CutForces.of(made.program)
    assert forces_of_lines(made, forces, feed, rpm).max() <= 60.0 * (1.0 + 1e-9)
    assert (rpm >= 30.0 / (np.pi * 0.006) - 1e-6).all()
    assert (rpm <= 140.0 / (np.pi * 0.006) + 1e-6).all()
    assert (feed >= 50.0 - 1e-9).all()
    assert (feed <= 3000.0 + 1e-9).all()
    advance = (feed / (2 * rpm))[:, made.program.cuts.line]
    for one, speed in zip(advance, rpm[:, made.program.cuts.line], strict=True):
        assert (one <= 0.05 * (1.0 + 1e-9)).all()
        torque_nm = forces.tangential_n(one) * 0.003
        assert (torque_nm <= 0.08 * (1.0 + 1e-6)).all()
        power_kw = torque_nm * speed * 2 * np.pi / 60 / 1000 / 0.8 + 0.1
        assert (power_kw <= 0.2 * (1.0 + 1e-4)).all()


def test_the_force_limit_is_met_and_not_only_kept() -> None:
    made = problem(second())
    forces = CutForces.of(made.program)
    advance = advance_at(forces.peak_n, np.full(len(forces.cuts), 60.0), len(forces.cuts))
    assert forces.peak_n(advance).max() == pytest.approx(60.0, rel=1e-10)


@pytest.mark.parametrize(
    ("limits", "says"),
    [
        ({"force_n": 2.0, "feed_mm_min": [500.0, 3000.0]}, "even 500 mm/min at 8000 rev/min give"),
        ({"surface_speed_m_min": [400.0, 500.0]}, "no speed of the spindle gives 400 to 500 m/min on 6 mm"),
        ({"chip_mm": [0.2, 0.3]}, "that cutting force allows is below the lowest of 200.0 µm"),
    ],
)
def test_what_cannot_be_kept_is_said_in_one_line(limits: dict[str, object], says: str) -> None:
    with pytest.raises(OptimisationError, match="line 8: ") as refused:
        problem(second(machine_toml=machine_with(text("second.toml"), limits=limits)))
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


OTHER_TOOL: dict[str, object] = {
    "tool": None,
    "tools": {"9": {"diameter_mm": 6.0, "teeth": 2, "tangential_coefficient_n_per_mm2": 800.0, "radial_ratio": 0.3}},
}


@pytest.mark.parametrize(
    ("sections", "says"), [({"limits": None}, "no \\[limits\\]"), ({"stock": None}, "no \\[stock\\]")], ids=["limits", "stock"]
)
def test_what_the_machine_does_not_say_is_asked_for(sections: dict[str, None], says: str) -> None:
    with pytest.raises(MachineError, match=says):
        problem(second(machine_toml=machine_with(text("second.toml"), **sections)))
    with pytest.raises(OptimisationError, match="no \\[cost\\]"):
        problem(second(machine_toml=machine_with(text("second.toml"), cost=None), objective=Objective.COST))


@pytest.mark.parametrize(
    ("sections", "says"),
    [
        (OTHER_TOOL, "none of the 3 feed lines may be changed; 3 of them: its tool is not described; write \\[tools.N\\]"),
        ({**OTHER_TOOL, "spindle": SPINDLE}, "its tool is not described"),
    ],
)
def test_a_program_in_which_nothing_may_be_changed_says_why(sections: dict[str, object], says: str) -> None:
    with pytest.raises(OptimisationError, match=says):
        optimise(second(machine_toml=machine_with(text("second.toml"), **sections)))


@pytest.mark.parametrize("more", [{}, {"limits": None}, {"stock": None}, {"limits": None, "stock": None}])
def test_a_machine_without_a_tool_says_so_before_anything_else_that_it_lacks(more: dict[str, None]) -> None:
    """A lathe has neither: to ask for limits, then for a block, then for a tool would lead nowhere."""
    with pytest.raises(MachineError, match=r"^no \[tool\]: no force is computed, so that there is nothing to choose"):
        problem(second(machine_toml=machine_with(text("second.toml"), tool=None, **more)))


def test_a_program_without_a_feed_move_says_so() -> None:
    with pytest.raises(OptimisationError, match="the program has no feed move"):
        optimise(second(program_text="G0 X10.\nM30\n"))


@pytest.mark.parametrize("effects", [(), EDGE, SIZE], ids=["nominal", "edge force", "size effect"])
@pytest.mark.parametrize("force_n", [None, 60.0])
def test_the_power_that_was_left_is_not_exceeded_by_what_is_written(effects: object, force_n: float | None) -> None:
    toml = machine_with(text("second.toml"), limits={"force_n": force_n, "power_kw": 0.15}, spindle=SPINDLE, effects=effects)
    answer = optimise(second(machine_toml=toml, evolutions=5, islands=1, population=16))
    assert answer.after.over == 0
    assert 0.14 < answer.after.power_kw <= 0.15 * (1.0 + 1e-9)


def test_the_uncertainty_of_a_tool_by_its_number_counts() -> None:
    tools = {"2": {"diameter_mm": 6.0, "teeth": 2, "tangential_coefficient_n_per_mm2": 1230.0, "radial_ratio": 0.5}}
    uncertainty = {"relative": 0.01, "tools.2.tangential_coefficient_n_per_mm2": 0.3}
    toml = machine_with(text("second.toml"), tools=tools, tool=None, uncertainty=uncertainty)
    program = text("second.nc").replace("S8000 M3", "T2 M6\nS8000 M3")
    answer = optimise(second(machine_toml=toml, program_text=program, evolutions=5, islands=1))
    assert answer.sensitivity is not None
    assert answer.sensitivity.parts[0].path == "tools.2.tangential_coefficient_n_per_mm2"
    assert answer.sensitivity.parts[0].force_pct > 30.0


def test_a_chattering_speed_is_not_chosen() -> None:
    """A tool whose first mode makes most speeds chatter at these depths: what is chosen lies in the lobes."""
    mode = {"direction": "y", "frequency_hz": 900.0, "damping_ratio": 0.03, "stiffness_n_per_mm": 24000.0}
    tool = {"modes": [mode, mode | {"direction": "x"}]}
    question = second(machine_toml=machine_with(text("second.toml"), tool=tool), evolutions=10, islands=1)
    made = problem(question)
    assert any(len(spans) > 1 or spans[0] != (1000.0, 8000.0) for spans in made.allowed.spans)
    answer = optimise(question)
    for row, spans in enumerate(made.allowed.spans):
        rpm = answer.lines[int(made.allowed.index[row])].after.spindle_rpm
        assert any(low - 0.01 <= rpm <= high + 0.01 for low, high in spans)
    assert answer.after.seconds >= optimise(second(evolutions=10, islands=1)).after.seconds


def spans_of_a_circle(start_deg: float, planned: bool) -> tuple[tuple[float, float], ...]:
    """The speeds that a circle of radius 21 mm around a pillar may have, 1 mm off it, whose tool gives way in y."""
    mode = {"direction": "y", "frequency_hz": 900.0, "damping_ratio": 0.03, "stiffness_n_per_mm": 9000.0}
    box = {"min_mm": [0.0, -30.0, -10.0], "max_mm": [60.0, 30.0, 0.0]}
    toml = machine_with(text("second.toml"), tool={"modes": [mode]}, stock=box)
    x, y = np.cos(np.radians(start_deg)), np.sin(np.radians(start_deg))
    circle = "G21 G90\nS8000 M3\nG0 Z10.\nX{0:.6f} Y{1:.6f}\nG1 Z-1.5 F200\nG2 I{2:.6f} J{3:.6f}\n"
    inner = circle.format(30.0 + 20.0 * x, 20.0 * y, -20.0 * x, -20.0 * y)
    outer = f"G1 X{30.0 + 21.0 * x:.6f} Y{21.0 * y:.6f}\nG2 I{-21.0 * x:.6f} J{-21.0 * y:.6f}\nG0 Z10.\nM30\n"
    cut = {7: [[1.5, np.pi - np.arccos(1.0 - 1.0 / 3.0), np.pi]]} if planned else None
    question = second(program_text=inner + outer, machine_toml=toml, planned=cut, left_alone={5: "slot", 6: "approach"})
    made = problem(question)
    (row,) = np.flatnonzero([made.program.lines[int(k)].line == 7 for k in made.allowed.index])
    return made.allowed.spans[row]


@pytest.mark.parametrize("planned", [False, True], ids=["from the stock", "from a run log"])
def test_on_an_arc_every_heading_of_it_has_to_be_stable(planned: bool) -> None:
    spans = [spans_of_a_circle(start_deg, planned) for start_deg in (0.0, 90.0, 150.0)]
    assert spans[0] != ((1000.0, 8000.0),)
    for other in spans[1:]:
        np.testing.assert_allclose(other, spans[0], rtol=1e-3)
