"""Lines that share a speed: which do, what is best for all of them, and that nothing else is written."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.depth import examples
from tests.twin.optimisation.benchmark import machine_with, paper, second, text
from twin.engagement.tool_sections import tool_numbers
from twin.errors import LimitsError
from twin.motion.path import Path, path_from_moves
from twin.optimisation.answer import Objective, Optimised, SpeedChanges
from twin.optimisation.bound import bound_of
from twin.optimisation.forces import CutForces
from twin.optimisation.optimise import Hooks, optimise
from twin.optimisation.paper import forces_of_lines
from twin.optimisation.problem import Problem
from twin.optimisation.question import Question, problem
from twin.optimisation.seeds import closed_form, worth_of
from twin.optimisation.speeds.groups import Kept, speed_groups
from twin.optimisation.speeds.stretches import changes_in_material
from twin.programs import interpret

SHORT = {"evolutions": 5, "population": 8, "islands": 1}
HEAD = "G21 G90\nS8000 M3\nG0 Z10.\nX-10. Y0.\nZ-0.4\n"
TAIL = "G0 Z10.\nM5\nM30\n"
SLOT = [0.0, float(np.pi)]
ANYWHERE, IN_AIR, PER_TOOL = SpeedChanges
QUICK_SPINDLE = machine_with(text("second.toml"), program={"spindle_acceleration_rpm_s": 80000.0})
DEPTHS = st.lists(st.sampled_from([0.05, 0.2, 0.4, 0.8, 1.2, 1.8, 2.4]), min_size=2, max_size=4)


def asked(body: str, changes: SpeedChanges = IN_AIR, tail: str = TAIL, toml: str = QUICK_SPINDLE, **more: object) -> Question:
    return Question(HEAD + body + tail, toml, speed_changes=changes).with_(**SHORT, **more)


def of_depths(depths: list[float], changes: SpeedChanges, **more: object) -> Question:
    """One cut after the other at these depths, the tool in the material all the time: 10 mm each."""
    body = "".join(f"G1 X{10 * k + 5}. F400\n" for k in range(len(depths)))
    planned = {5 + k: [[depth, *SLOT]] for k, depth in enumerate(depths)}
    return asked(body, changes, planned=planned, **more)


def path_of(program: str) -> Path:
    return path_from_moves(interpret(program))


def speeds_by_line(answer: Optimised) -> dict[int, float]:
    return {line.line: line.after.spindle_rpm for line in answer.lines}


def groups_of(question: Question) -> list[list[int]]:
    """Lines of each group, as people count them."""
    made = problem(question)
    return [[made.program.lines[int(made.allowed.index[row])].line + 1 for row in rows] for rows in made.groups.rows]


def value_of(made: Problem, objective: Objective, feed: np.ndarray, rpm: np.ndarray) -> list[float]:
    worth = worth_of(made, objective)
    real = feed * made.allowed.feed_ratio
    return [float(worth.of(rows, real[rows], rpm[rows[0]])) for rows in made.groups.rows]


LIMITS = [{}, {"power_kw": 0.15}, {"surface_speed_m_min": [40.0, 120.0]}, {"force_n": None}]


@pytest.mark.parametrize("limits", LIMITS, ids=lambda limits: next(iter(limits), "force"))
@pytest.mark.parametrize("objective", [Objective.TIME, Objective.COST])
@settings(max_examples=examples(4), deadline=None)
@given(DEPTHS, st.floats(200.0, 900.0), st.floats(0.12, 0.5), st.sampled_from(["in_cut", "in_program"]))
def test_no_common_speed_of_a_grid_is_better_and_none_beats_each_line_by_itself(
    limits: dict[str, object], objective: Objective, depths: list[float], taylor_c: float, taylor_n: float, wears: str
) -> None:
    cost = {"taylor_c_m_per_min": taylor_c, "taylor_n": taylor_n, "tool_wears": wears}
    spindle = {"rated_power_kw": 1.0, "efficiency": 0.8, "idle_power_kw": 0.05}
    toml = machine_with(QUICK_SPINDLE, limits=limits, cost=cost, spindle=spindle)
    made, apart = (problem(of_depths(depths, changes, toml=toml)) for changes in (IN_AIR, ANYWHERE))
    feed, rpm = closed_form(made, objective)
    assert len(set(rpm.tolist())) == 1
    (own,) = value_of(made, objective, feed, rpm)
    grid = np.concatenate([np.linspace(a, b, 400) for a, b in made.spans[0]])
    most = made.allowed.feed_max(np.repeat(grid[:, None], len(feed), axis=1))
    worth = worth_of(made, objective)
    assert own <= worth.of(made.groups.rows[0], most * made.allowed.feed_ratio, grid).min() * (1.0 + 1e-9)
    assert own >= sum(value_of(apart, objective, *closed_form(apart, objective))) * (1.0 - 1e-9)


def test_by_hand_two_depths_at_one_speed() -> None:
    """For time: the shallow cut takes its feed range, the deep one its force at the fastest spindle; wear counts for nothing."""
    made = problem(of_depths([0.2, 0.8], IN_AIR))
    feed, rpm = closed_form(made, Objective.TIME)
    assert rpm.tolist() == [8000.0, 8000.0]
    advance = 60.0 / (1230.0 * 0.8 * 1.25**0.5)
    assert feed == pytest.approx([3000.0, advance * 2 * 8000.0])


@pytest.mark.parametrize("changes", [IN_AIR, PER_TOOL])
@pytest.mark.parametrize("objective", [Objective.TIME, Objective.COST])
@settings(max_examples=examples(8), deadline=None)
@given(st.integers(0, 2**32), DEPTHS)
def test_every_candidate_keeps_every_limit_at_one_speed_and_is_not_below_the_bound(
    objective: Objective, changes: SpeedChanges, seed: int, depths: list[float]
) -> None:
    toml = machine_with(QUICK_SPINDLE, limits={"surface_speed_m_min": [30.0, 140.0]})
    made = problem(of_depths(depths, changes, toml=toml, objective=objective))
    genes = np.random.default_rng(seed).random((32, made.genes))
    genes[:16, : len(depths)] = 1.0
    feed, rpm = made.decoded(genes)
    assert made.genes == len(depths) + 1
    assert (rpm == rpm[:, :1]).all()
    assert forces_of_lines(made, CutForces.of(made.program), feed, rpm).max() <= 60.0 * (1.0 + 1e-9)
    assert (rpm <= 140.0 / (np.pi * 0.006) + 1e-6).all()
    assert made.decoded(made.encoded(feed[0], rpm[0])[None])[1][0] == pytest.approx(rpm[0], rel=1e-9)
    values = made.evaluate(genes)[0 if objective is Objective.TIME else 1]
    assert bound_of(made, objective, float(values.min())).value <= values.min() * (1.0 + 1e-9)


@pytest.mark.parametrize("changes", list(SpeedChanges))
@pytest.mark.parametrize("objective", [Objective.TIME, Objective.COST])
def test_the_papers_benchmark_has_one_speed_however_it_is_asked(objective: Objective, changes: SpeedChanges) -> None:
    answer = optimise(paper(objective=objective, speed_changes=changes, **SHORT))
    assert answer.after.seconds == pytest.approx(24.51, abs=0.005)
    assert answer.after.cost == pytest.approx(76.40, abs=0.03)
    assert answer.bound.exact
    assert answer.bound.distance < 1e-3
    assert answer.changes_in_material == 0


@pytest.mark.parametrize("objective", [Objective.TIME, Objective.COST])
def test_where_the_control_is_ideal_the_bound_of_groups_is_reached(objective: Objective) -> None:
    toml = machine_with(text("paper.toml"), limits={"feed_mm_min": [50.0, 3000.0]})
    planned = {2: [[0.1, *SLOT]], 3: [[1.2, *SLOT]], 4: [[0.4, *SLOT]]}
    question = Question("G21 G90\nS8000 M3\nG1 X10. F400\nX20.\nX30.\nM5\nM30\n", toml, planned=planned, objective=objective)
    answer = optimise(question.with_(speed_changes=IN_AIR, **SHORT))
    assert answer.bound.exact
    assert answer.bound.distance < 1e-3
    assert answer.bound.how.startswith("each group of lines that share a speed at its own optimum, which a program reaches")


def test_a_speed_that_changes_in_the_material_is_said_with_the_way_out_and_what_it_takes() -> None:
    anywhere, in_air = (optimise(of_depths([0.05, 1.2], changes, objective=Objective.COST)) for changes in (ANYWHERE, IN_AIR))
    assert len(set(speeds_by_line(anywhere).values())) == 2
    assert anywhere.changes_in_material == 1
    (note,) = (one for one in anywhere.notes if "while the tool is in the material" in one)
    assert note.startswith("the spindle changes its speed once while the tool is in the material")
    assert anywhere.after.cost is not None
    assert in_air.after.cost is not None
    more = in_air.after.cost - anywhere.after.cost
    assert more > 0.0
    said = float(note.split("--speed-changes in_air keeps one speed there, for about ")[1].split(" KRW more")[0])
    assert said == pytest.approx(more, rel=0.15)
    assert len(set(speeds_by_line(in_air).values())) == 1
    assert in_air.changes_in_material == 0
    assert len([event for event in path_of(in_air.program).events if event.kind == 2 and event.value]) == 1
    assert "by --speed-changes in_air the 2 lines whose speed may change are one speed" in in_air.notes
    assert in_air.limits["changes of speed"] == "only where the tool is clear of the material"
    assert "a speed it shares" in " ".join(line.binds for line in in_air.lines)
    assert in_air.as_json()["speed_changes"] == "in_air"


def test_a_speed_that_the_program_changed_in_the_material_is_changed_no_more() -> None:
    body = "G1 X20. F400\nX40. S5000\nS6000\nG0 Z10.\nX-10. Y20.\nZ-0.05\nG1 X40. S7000\n"
    question = asked(body, objective=Objective.COST)
    before = problem(question)
    assert len(changes_in_material(before.program, before.program.path)) == 1
    answer = optimise(question)
    assert changes_in_material(before.program, path_of(answer.program)) == ()
    speeds = speeds_by_line(answer)
    assert speeds[5] == speeds[6] != speeds[11]
    assert answer.program.splitlines()[7] == f"S{speeds[6]:.0f}", "the word before the rapid out too"
    assert answer.program.splitlines()[11] == f"G1 X40. S{speeds[11]:.0f} F3000"


@pytest.mark.parametrize(
    ("between", "groups"),
    [
        ("", [[6, 7]]),
        ("G0 X20.\n", [[6, 8]]),
        ("G0 Z0.9\nG0 X20.\nG0 Z-0.4\n", [[6, 10]]),
        ("G0 Z1.\nG0 X20.\nG0 Z-0.4\n", [[6], [10]]),
        ("G1 Z5. F100\nG0 X20.\nG1 Z-0.4\n", [[6], [10]]),
        ("G1 X10. F200\n", [[6, 8]]),
        ("G0 X60.\n", [[6], [8]]),
        ("G1 X60.\n", [[6, 7], [8]]),
        ("M6 T2\nS8000 M3\n", [[6], [9]]),
    ],
    ids=[
        "at once",
        "back through the slot",
        "not clear",
        "out and in",
        "fed out and in",
        "spring pass",
        "beside",
        "cut out",
        "tool",
    ],
)
def test_a_stretch_ends_where_the_tool_is_clear_of_the_stock(between: str, groups: list[list[int]]) -> None:
    question = asked("G1 X40. F400\n" + between + "G1 X44. Y5.\n")
    assert groups_of(question) == groups
    assert groups_of(question.with_(speed_changes=ANYWHERE)) == [[one] for group in groups for one in group]


def test_a_subprogram_that_is_called_from_two_places_joins_them() -> None:
    body = "G1 X20. F400\nM98 P9\nG90 G0 Z10.\nX-10. Y20.\nZ-0.4\nG1 X20. F400\nM98 P9\nG90\n"
    tail = TAIL + "O9\nG91 G1 X10.\nM99\n"
    assert groups_of(asked(body, tail=tail)) == [[6, 18, 11]]
    alone = body.replace("M98 P9\n", "", 1)
    assert len(groups_of(asked(alone, tail=tail))) == 2
    answer = optimise(asked(body, tail=tail))
    assert len(set(speeds_by_line(answer).values())) == 1
    assert answer.changes_in_material == 0


def test_a_line_that_is_left_alone_holds_the_speed_of_its_stretch_and_of_no_other() -> None:
    body = "G1 X20. F400\nX40. S5000\nG0 Z10.\nX-10. Y20.\nZ-0.4\nG1 X40. S8000\n"
    question = asked(body, left_alone={6: "it was to be left alone"}, objective=Objective.COST)
    made = problem(question)
    assert made.groups.kept == (Kept(1, 5000.0), None)
    answer = optimise(question)
    speeds = speeds_by_line(answer)
    assert speeds[5] == speeds[6] == 5000.0
    assert speeds[10] not in (5000.0, 8000.0)
    assert answer.changes_in_material == 0
    assert "line 7 is left alone at 5000 rev/min, and holds the line that shares its speed" in answer.notes
    assert optimise(question.with_(speed_changes=ANYWHERE)).changes_in_material == 1


def test_a_feed_down_into_a_slot_takes_the_new_speed_before_it() -> None:
    """The first slot is held at 8000; on the way into it again by a feed, the speed changes above, not at the end of it."""
    body = "G1 X20. F400\nG0 Z10.\nX0.\nG1 Z-0.4 F300\nX40.\n"
    question = asked(body, left_alone={5: "it was to be left alone"}, objective=Objective.COST)
    answer = optimise(question)
    speeds = speeds_by_line(answer)
    assert speeds[5] == 8000.0
    assert speeds[8] == speeds[9] != 8000.0
    assert f"G1 Z-0.4 F300 S{speeds[9]:.0f}" in answer.program
    assert "S" not in answer.program.splitlines()[9]


def test_each_tool_has_one_speed_in_whatever_order_it_comes() -> None:
    cut = "G0 Z10.\nX-10. Y{0}.\nZ-{1}\nG1 X60. F400\n"
    body = "".join(
        f"T{t} M6\nS8000 M3\n" + cut.format(y, d) for t, y, d in ((1, 0, 0.05), (2, 20, 1.2), (1, 30, 1.2), (2, 45, 0.05))
    )
    described = {"diameter_mm": 6.0, "teeth": 2, "tangential_coefficient_n_per_mm2": 1230.0, "radial_ratio": 0.5}
    toml = machine_with(QUICK_SPINDLE, tools={"1": described, "2": described | {"teeth": 3}}, tool=None)
    by_tool, in_air = (optimise(asked(body, how, toml=toml, objective=Objective.COST)) for how in (PER_TOOL, IN_AIR))
    assert len(set(speeds_by_line(in_air).values())) > 1
    path = path_of(by_tool.program)
    numbers, rpm = tool_numbers(path), path.commanded_rpm()
    feeding = path.kind > 0
    of_tools = {number: set(rpm[feeding & (numbers == number)].tolist()) for number in (1, 2)}
    assert [len(speeds) for speeds in of_tools.values()] == [1, 1]
    said = ", ".join(f"T{number} {speeds.pop():g} rev/min" for number, speeds in of_tools.items())
    assert f"one speed for each tool: {said}" in by_tool.notes
    assert by_tool.after.cost is not None
    assert in_air.after.cost is not None
    assert by_tool.after.cost >= in_air.after.cost


@pytest.mark.parametrize(
    ("lobes", "says"),
    [
        (
            [((1000.0, 2400.0), (3000.0, 4000.0)), ((5000.0, 8000.0),), ((1000.0, 8000.0),)],
            "line 6 and line 7 share one speed by --speed-changes in_air, and none suits all: 1000 to 2400, 3000 to 4000 and "
            "5000 to 8000 rev/min; another limit, --leave 7, or --speed-changes anywhere",
        ),
        (
            [((1000.0, 4000.0),), ((1000.0, 2000.0), (3500.0, 6000.0)), ((2500.0, 3000.0), (5000.0, 7000.0))],
            "line 6 and those after it and line 8 share one speed by --speed-changes in_air, and none suits all: 1000 to 2000, "
            "3500 to 4000 and 2500 to 3000, 5000 to 7000 rev/min; another limit, --leave 8, or --speed-changes anywhere",
        ),
        ([((1000.0, 2000.0), (3500.0, 6000.0)), ((2000.0, 3500.0),), ((1000.0, 8000.0),)], ""),
    ],
    ids=["two lines", "all together", "where they touch"],
)
def test_lobes_that_no_speed_lies_in_are_named(lobes: list[tuple[tuple[float, float], ...]], says: str) -> None:
    made = problem(of_depths([0.4, 0.8, 1.2], ANYWHERE))
    allowed, groups, why = speed_groups(made.program, made.allowed.with_spans(lobes), IN_AIR)
    assert why == says
    assert len(groups) == 1
    if not says:
        assert allowed.spans == (((2000.0, 2000.0), (3500.0, 3500.0)),) * 3


def test_lobes_that_cuts_in_two_directions_leave_may_not_meet() -> None:
    """One mode along X, one along Y of another frequency: deep slots along each are stable in lobes of their own."""
    modes = [
        {"direction": axis, "frequency_hz": hz, "damping_ratio": 0.01, "stiffness_n_per_mm": 4000.0}
        for axis, hz in (("x", 260.0), ("y", 170.0))
    ]
    toml = machine_with(QUICK_SPINDLE, tool={"modes": modes}, limits={"force_n": None, "spindle_rpm": [4000.0, 8000.0]})
    question = asked("G1 X20. F400\nY20.\n", ANYWHERE, planned={5: [[2.0, 0.0, 0.6]], 6: [[2.0, 0.0, 0.6]]}, toml=toml)
    assert all(problem(question).allowed.spans)
    with pytest.raises(LimitsError, match="line 6 and line 7 share one speed by --speed-changes in_air, and none suits all"):
        problem(question.with_(speed_changes=IN_AIR))


@pytest.mark.parametrize(
    ("changes", "body", "leave", "says"),
    [
        (
            IN_AIR,
            "G1 X20. F400 S9000\nX40. S8000\n",
            {5: "so"},
            "line 6 is left alone at 9000 rev/min, and by --speed-changes in_air its speed is that of line 7, which may have "
            "1000 to 8000 rev/min; another limit, --leave 7, or --speed-changes anywhere",
        ),
        (
            PER_TOOL,
            "G1 X20. F400\nX30. S6000\nX40.\n",
            {5: "so", 6: "so"},
            "lines 6 and 7 are left alone at 8000 and 6000 rev/min, and by --speed-changes per_tool line 8 has the speed of "
            "both; --leave 8, or --speed-changes in_air or anywhere",
        ),
    ],
)
def test_lines_left_alone_that_leave_no_speed_are_named(
    changes: SpeedChanges, body: str, leave: dict[int, str], says: str
) -> None:
    with pytest.raises(LimitsError) as refused:
        problem(asked(body, changes, left_alone=leave))
    assert str(refused.value) == says


def test_a_word_that_cannot_be_written_over_holds_the_speed_before_it() -> None:
    answer = optimise(asked("#1=5000\nG1 X20. F400\nS#1\nX40.\n"))
    assert answer.changes_in_material == 0
    assert speeds_by_line(answer) == {6: 5000.0, 8: 5000.0}
    assert answer.lines[1].left_alone == "a word that cannot be changed sets the speed before it"


def test_without_a_stock_a_rapid_leads_out() -> None:
    toml = machine_with(QUICK_SPINDLE, stock=None)
    body = "G1 X20. F400\nX40.\nG0 X20.\nG1 Y10.\n"
    question = asked(body, toml=toml, planned={5: [[0.4, *SLOT]], 6: [[0.4, *SLOT]], 8: [[0.4, *SLOT]]})
    assert groups_of(question) == [[6, 7], [9]]
    assert "no [stock]: every rapid is taken to lead out of the material" in optimise(question).notes


def test_fewer_changes_are_never_better_than_more() -> None:
    answers = [optimise(of_depths([0.05, 1.2, 0.4], changes, objective=Objective.COST)).after for changes in SpeedChanges]
    values = [one.cost or 0.0 for one in answers]
    assert values == pytest.approx(sorted(values), rel=1e-4), "whole rev/min aside"
    assert values[0] < 0.999 * values[1]


def test_the_choice_is_part_of_the_question() -> None:
    question = second(speed_changes=PER_TOOL)
    assert Question.from_json(question.to_json()) == question
    assert question.digest() != second().digest()
    kept: list[str] = []
    given_before, asked_now = (of_depths([0.05, 1.2], changes) for changes in (ANYWHERE, PER_TOOL))
    plain = optimise(given_before, Hooks(save=kept.append))
    passed_over, anew = optimise(asked_now, checkpoint=kept[-1]), optimise(asked_now)
    assert replace(passed_over, search=plain.search) == replace(anew, search=plain.search)
