"""The program rewritten: feeds and speeds, and nothing else."""

import numpy as np
import pytest

from tests.twin.optimisation.benchmark import machine_with, second, text
from twin.errors import OptimisationError
from twin.motion.path import path_from_moves
from twin.optimisation.answer import Objective
from twin.optimisation.optimise import optimise
from twin.optimisation.program import NEAR, SPRING
from twin.optimisation.question import Question, problem
from twin.optimisation.rewriting import rewritten
from twin.programs import Settings, interpret
from twin.programs.fanuc.words import find_word
from twin.programs.source import source_lines

SHORT = {"evolutions": 5, "population": 8, "islands": 1}
HEAD = "%\r\nO7 (SLOT F1 S1)\r\nG21 G90 G94\r\nS8000\r\nM3\r\nG0 Z10.\r\nX-10. Y0.\r\nZ-0.4\r\n"
TAIL = "G0 Z10.\r\nM5\r\nM30\r\n%\r\n"


def asked(body: str, head: str = HEAD, tail: str = TAIL, **changes: object) -> Question:
    return Question(head + body.replace("\n", "\r\n") + tail, text("second.toml")).with_(**SHORT, **changes)


def without_words(line: str) -> str:
    for letter in "FS":
        if (place := find_word(line, letter)) is not None:
            line = line[: place.begin] + line[place.end :]
    return line.replace(" ", "")


@pytest.mark.parametrize(
    "body",
    [
        "N1 G1 X30. F400 (FAST F9999)\nN2 X60.\n",
        "g1x30f400 ; slow\nx60f300\n",
        "/N1 G1 X30. F400\nG1X60.\n",
        "#1=30.\nWHILE[#1 LE 60.]DO1\nG1 X#1 F400\n#1=#1+15.\nEND1\n",
        "G1 X30. F400\nG4 P100\nX60.\n",
        "G1 X10. F400\nG2 X20. Y10. R10.\nG3 X30. Y20. J10. I0. F200\n",
        "G20\nG1 X1.2 F15.\nG21\n",
    ],
    ids=["comment", "dense", "skip", "loop", "dwell", "arcs", "inch"],
)
def test_nothing_but_feeds_and_speeds_changes(body: str) -> None:
    question = asked(body)
    answer = optimise(question)
    before, after = source_lines(question.program_text), source_lines(answer.program)
    assert [without_words(line) for line in after] == [without_words(line) for line in before]
    assert answer.program.count("\r\n") == question.program_text.count("\r\n")
    assert "(SLOT F1 S1)" in answer.program
    one, other = (path_from_moves(interpret(program)) for program in (question.program_text, answer.program))
    assert np.array_equal(one.end_mm, other.end_mm)
    assert answer.after.force_n <= 60.0
    assert answer.after.seconds < answer.before.seconds


def test_a_speed_word_apart_from_its_m3_is_found() -> None:
    answer = optimise(asked("G1 X60. F400\n"))
    changed = [line for line in answer.program.split("\r\n") if line.startswith("S")]
    assert changed == [f"S{answer.lines[0].after.spindle_rpm:.0f}"]


@pytest.mark.parametrize(
    ("body", "line", "why"),
    [
        ("G1 X30. F[100.+300.]\nX60. F400\n", 8, "its feed is an expression"),
        ("G1 X30. F400\nG95 G1 X60. F0.05\nG94\n", 9, "its feed is tied to the spindle"),
        ("G1 X20. F400\nX30. Z-0.8\nX60.\n", 9, "it goes down into material"),
        ("G1 X30. F400\nG99 G81 X40. Z-2. R12. F100\nG80\nG1 Z-0.4 F300\nX60.\n", 9, "its feed is part of a cycle"),
        ("G1 Z-0.3 F200\nX30. F400\nX30. Y0.1 Z-0.4\n", 10, "it goes down into material"),
    ],
    ids=["expression", "feed per turn", "ramp", "cycle", "plunge"],
)
def test_what_is_left_alone_keeps_its_feed_and_speed(body: str, line: int, why: str) -> None:
    answer = optimise(asked(body))
    alone = next(one for one in answer.lines if one.line == line)
    assert why in alone.left_alone
    assert alone.after.feed_mm_min == pytest.approx(alone.before.feed_mm_min, rel=1e-9)
    assert alone.after.spindle_rpm == pytest.approx(alone.before.spindle_rpm, rel=1e-9)


@pytest.mark.parametrize(
    ("body", "tail", "stays"),
    [
        ("G1 X30. F400\nM4\nG98 G74 X40. Y30. Z-5. R2. F800.\nG80\n", TAIL, "-8000"),
        ("G1 X30. F400\nM5\nG31 X35. F50.\n", TAIL, "F50."),
        ("G1 X30. F400\nM5\nG1 Y30. F60.\n", TAIL, "F60."),
        ("M5\nS8000\nG65 P9 S30.\nM3\nG1 X30. F400\n", "G0 Z10.\r\nM5\r\nM30\r\nO9\r\n#100=#19\r\nM99\r\n%\r\n", "G65 P9 S30."),
        ("(NOT G20)\nG1 X30. F400\n", TAIL, "(NOT G20)"),
    ],
    ids=["left-hand tap", "probe", "spindle at rest", "argument of a macro", "G20 in a comment"],
)
def test_what_is_no_cut_keeps_its_words(body: str, tail: str, stays: str) -> None:
    question = asked(body, tail=tail)
    answer = optimise(question)
    assert "G1 X30. F400" not in answer.program, "the cut is another one"
    before, after = (path_from_moves(interpret(program)) for program in (question.program_text, answer.program))
    if stays == "-8000":
        tap = [k for k in range(len(before)) if before.commanded_rpm()[k] < 0.0]
        assert tap
        assert after.commanded_rpm()[tap].tolist() == before.commanded_rpm()[tap].tolist()
    else:
        assert stays in answer.program


@pytest.mark.parametrize("skip", [frozenset(), frozenset({1})], ids=["run", "skipped"])
def test_a_block_that_is_skipped_takes_no_feed_or_speed_with_it(skip: frozenset[int]) -> None:
    question = asked("G1 X-8. F400\n/X30. F300 S7000\nX60.\nY5. Z-0.4\n")
    answer = optimise(question)
    path = path_from_moves(interpret(answer.program, Settings(block_skip=skip)))
    feeds = {int(line): float(feed) for line, feed in zip(path.line, path.feed_mm_min, strict=True)}
    for line in answer.lines:
        if line.line in feeds and not line.left_alone:
            assert feeds[line.line] == pytest.approx(line.after.feed_mm_min)
    assert float(path.commanded_rpm()[path.line == 10][0]) == next(
        one.after.spindle_rpm for one in answer.lines if one.line == 10
    )


@pytest.mark.parametrize(
    ("head", "lines"),
    [
        ("G21 G90\nS8000 M3\nG0 X30. Y5.\nG0 Z10.\nX-10.\nZ-0.4\nG1 X60. F400\n", ()),
        ("G21 G90\nS8000 M3\nG0 Z10.\nX-10. Y30.\nZ-2.\nX30.\nG1 X60. F400\n", (6,)),
    ],
    ids=["from where nobody knows", "through the stock"],
)
def test_a_rapid_into_material_is_said_first(head: str, lines: tuple[int, ...]) -> None:
    stock = machine_with(text("second.toml"), stock={"min_mm": [0.0, -10.0, -10.0], "max_mm": [50.0, 50.0, 0.5]})
    answer = optimise(Question(head + "G0 Z10.\nM30\n", stock).with_(**SHORT))
    assert answer.collisions == lines
    assert ("a RAPID GOES INTO MATERIAL in line 6" in answer.sentence) == bool(lines)
    assert any("rapid into material" in note for note in answer.notes) == bool(lines)


def test_a_macro_somewhere_does_not_put_words_on_every_line() -> None:
    loop = "#1=0\nWHILE[#1 LT 2]DO1\nG0 Z10.\n#1=#1+1\nEND1\n"
    straight = "G1 X20. F400\nX30.\nX40.\nX50.\nX60.\n"
    plain, with_loop = (optimise(asked(body)).program for body in (straight, straight + loop))
    assert with_loop.replace(loop.replace("\n", "\r\n"), "") == plain
    assert plain.count("F") == 3, "one feed, and two in the name of the program"


def test_a_line_that_is_asked_to_be_left_alone_is() -> None:
    answer = optimise(asked("G1 X30. F400\nX60. F300\n", left_alone={8: "it was to be left alone"}))
    assert "G1 X30. F400" in answer.program
    assert answer.lines[0].after.feed_mm_min == 400.0
    assert answer.lines[1].after.feed_mm_min > 300.0


def test_tools_by_their_numbers_cut_by_their_own_constants() -> None:
    tools = {
        "2": {"diameter_mm": 6.0, "teeth": 2, "tangential_coefficient_n_per_mm2": 1230.0, "radial_ratio": 0.5},
        "3": {"diameter_mm": 10.0, "teeth": 4, "tangential_coefficient_n_per_mm2": 2460.0, "radial_ratio": 0.5},
    }
    first_cut = "T2 M6\nS8000 M3\nG1 X60. F400\nG0 Z10.\nX-10. Y30.\n"
    body = first_cut + "T3 M6\nS8000 M3\nZ-0.4\nG1 X60. F400\nG0 Z10.\nX-10. Y-30.\nT4 M6\nG1 X-5.\n"
    question = asked(body).with_(machine_toml=machine_with(text("second.toml"), tools=tools, tool=None))
    answer = optimise(question)
    first, second, third = answer.lines
    assert first.before.chip_mm == 400.0 / (2 * 8000.0)
    assert second.before.chip_mm == 400.0 / (4 * 8000.0)
    # half the chip at twice the coefficient, two teeth at a time: the same peak, and more than twice the power at 10 mm
    assert second.before.force_n == pytest.approx(first.before.force_n, rel=1e-9)
    assert second.before.power_kw == pytest.approx(first.before.power_kw * 2.0 * 10.0 / 6.0, rel=1e-6)
    assert "write [tools.N]" in third.left_alone
    assert max(first.after.force_n, second.after.force_n) <= 60.0


def test_a_line_that_does_not_follow_its_words_is_named_and_not_written_over() -> None:
    """The feed of a subprogram's line is that of its caller; two callers want two feeds, one line has one."""
    body = "G1 X20. F400\nM98 P9\nG1 F300\nM98 P9\n"
    tail = "G0 Z10.\r\nM5\r\nM30\r\nO9\r\nG91 G1 X10.\r\nG90\r\nM99\r\n%\r\n"
    answer = optimise(asked(body, tail=tail))
    assert "G91 G1 X10. F" in answer.program
    shared = next(one for one in answer.lines if one.text_before == "G91 G1 X10.")
    assert shared.after.feed_mm_min > 400.0
    made = problem(asked(body, tail=tail))
    text_ = rewritten(made, np.full(len(made.allowed), 500.0), np.where(made.allowed.cutting, 8000.0, 0.0))
    assert text_.not_followed == {}


def test_a_spring_pass_and_a_feed_out_of_the_material_are_no_air() -> None:
    answer = optimise(asked("G1 X40. F400\nX10. F200 (SPRING PASS)\nG1 Z5. F100\n"))
    assert "X10. F200 (SPRING PASS)" in answer.program
    assert "G1 Z5. F100" in answer.program
    clear = optimise(asked("G1 X40. F400\nG0 Z20.\nG1 X10. F200\n"))
    assert "G1 X10. F3000" in clear.program


def test_a_line_that_was_not_run_and_has_no_feed_of_its_own_stops_it() -> None:
    body = "#500=0\nG1 X20. F400\nIF[#500 EQ 1]GOTO 9\nX60. F300\nGOTO 10\nN9 X30.\nN10 G0 Z10.\n"
    with pytest.raises(OptimisationError, match=r"line 14 was not run .* has no F of its own"):
        optimise(asked(body))
    answer = optimise(asked(body.replace("N9 X30.", "N9 X30. F250")))
    assert "N9 X30. F250" in answer.program


def test_a_line_that_is_left_alone_above_a_limit_is_said_first() -> None:
    answer = optimise(asked("G1 X30. F400\nX60.\n", left_alone={9: "it was to be left alone"}, force_limit_n=10.0))
    assert answer.after.over == 1
    assert answer.sentence.startswith("1 line left alone ABOVE A LIMIT")


TWICE = (
    "G21 G90\nS8000\n{start}\nG0 Z10.\nX-10. Y0.\nZ-0.4\nG1 X60. F400\nM5\n{start}\n"
    "G0 Z10.\nX-10. Y20.\nZ-1.2\nG1 X60.\nG0 Z10.\nM30\n"
)


@pytest.mark.parametrize("text_of_start", ["M3", "M98 P7"], ids=["two starts", "one start called twice"])
@pytest.mark.parametrize("objective", [Objective.TIME, Objective.COST])
def test_two_starts_by_one_s_word_are_no_slower_than_the_same_program_at_one_speed(
    text_of_start: str, objective: Objective
) -> None:
    program = TWICE.format(start=text_of_start) + ("" if text_of_start == "M3" else "O7\nM3\nM99\n")
    question = second(program_text=program, objective=objective, evolutions=10, islands=1)
    plain = problem(
        question.with_(program_text=program.replace("F400", "F1745").replace("Z-1.2\nG1 X60.", "Z-1.2\nG1 X60. F581.7"))
    )
    seconds, cost = plain.evaluate_path(plain.program.path)
    answer = optimise(question)
    assert answer.after.over == 0
    if objective is Objective.TIME:
        assert answer.after.seconds <= seconds
    else:
        assert answer.after.cost is not None
        assert answer.after.cost <= cost


def test_the_second_of_two_starts_gets_an_s_word_of_its_own() -> None:
    answer = optimise(second(program_text=TWICE.format(start="M3"), evolutions=10, islands=1))
    lines = answer.program.splitlines()
    assert lines[2] == "M3"
    assert lines[8].startswith("M3 S")
    assert lines[8][3:] != lines[1]


WALL = (
    "G21 G90\nS8000 M3\nG0 Z10.\nX-3.5 Y-1.\nG1 Z-0.4 F2000\nX70. F400\nY-9.\nX-3.5\n"  # 2 mm of a wall, and out
    "Y-1.\nX70. F900\nG0 Z10.\nM30\n"  # back to it, and along it once more
)


@pytest.mark.parametrize("objective", [Objective.TIME, Objective.COST])
def test_a_spring_pass_keeps_feed_and_speed_and_an_approach_the_feed(objective: Objective) -> None:
    answer = optimise(second(program_text=WALL, objective=objective, evolutions=10, islands=1))
    lines = {line.line: line for line in answer.lines}
    assert lines[5].after.spindle_rpm != 8000.0 or objective is Objective.TIME
    assert lines[9].left_alone == SPRING
    assert (lines[9].after.feed_mm_min, lines[9].after.spindle_rpm) == (900.0, 8000.0)
    assert lines[8].left_alone == NEAR
    assert lines[8].after.feed_mm_min == 400.0


def test_a_ramp_of_a_run_log_is_left_alone_as_one_of_the_stock_is() -> None:
    ramp = "G21 G90\nS8000 M3\nG0 Z0.\nG1 X10. Z-1. F200\nX40.\nM30\n"
    cuts = {3: [[0.5, 0.0, np.pi]], 4: [[1.0, 0.0, np.pi]]}
    answer = optimise(second(program_text=ramp, planned=cuts, evolutions=2, islands=1, population=8))
    lines = {line.line: line for line in answer.lines}
    assert "goes down into material" in lines[3].left_alone
    assert lines[3].after.feed_mm_min == 200.0
    assert not lines[4].left_alone
