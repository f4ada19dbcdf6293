"""Lines whose feed is not their F word, or that take no word: arcs at the feed of the contour, and calls."""

import pytest

from tests.twin.optimisation.test_languages import MACHINE, TOOLS
from twin.optimisation.answer import Optimised
from twin.optimisation.optimise import optimise
from twin.optimisation.program import AT_CONTOUR, NEAR
from twin.optimisation.question import Question
from twin.programs.source import source_lines

HEAD = "G17 G90 G71\nT1 M6\nD1\nS5000 M3\nG0 X0 Y20\nZ0\n"
CONTOUR = HEAD + "G1 G41 X25 Y30 F600\nY79\nG2 X31 Y85 CR=6\nG1 X109\nG2 X115 Y79 CR=6\nG1 Y35\nG40 X130 Y20\nG0 Z50\nM30\n"
KLARTEXT = """0 BEGIN PGM A MM
1 TOOL CALL 1 Z S5000
2 L X0 Y20 R0 FMAX M3
3 L Z0 R0 FMAX
4 L X+25 Y+30 RL F600 M109
5 L Y+79
6 CR X+31 Y+85 R+6 DR-
7 L X+109
8 CR X+115 Y+79 R+6 DR-
9 L Y+35
10 L X+130 Y+20 R0
11 L Z+50 R0 FMAX M30
12 END PGM A MM
"""
POCKET = "POCKET3(50,6,2,-2,60,50,12,70,60,0,3,0.2,0.1,700,150,0,11,6)"
CALL = HEAD + "Y35\nG1 X130 F600\n{}\n" + POCKET + "\nG0 X0 Y80\nZ0\nG1 X130 F600\nG0 Z50\nM30\n"


def answer(text: str, name: str, **changes: object) -> Optimised:
    short = {"evolutions": 1, "population": 8, "islands": 1, **changes}
    return optimise(Question(text, MACHINE + TOOLS, name=name).with_(**short), resimulate=False)


@pytest.mark.parametrize(("text", "name", "arcs"), [(CONTOUR, "a.mpf", (8, 10)), (KLARTEXT, "a.h", (6, 8))], ids=["CFC", "M109"])
@pytest.mark.parametrize("left", [False, True], ids=["found out", "given with --leave"])
def test_an_arc_at_the_feed_of_the_contour_keeps_its_f_word(text: str, name: str, arcs: tuple[int, ...], left: bool) -> None:
    found = answer(text, name, left_alone=dict.fromkeys(arcs, "asked") if left else {})
    alone = [one for one in found.lines if one.left_alone in (AT_CONTOUR, "asked")]
    assert len(alone) == len(arcs)
    for one in alone:
        assert one.after.feed_mm_min == pytest.approx(one.before.feed_mm_min, rel=1e-6)
        assert one.before.feed_mm_min > 700.0
    written = source_lines(found.program)
    assert [" F600" in written[arc] for arc in arcs] == [True, True]
    assert found.after.seconds < found.before.seconds


@pytest.mark.parametrize("between", ["G0 Z50", "G1 Z50"], ids=["a rapid takes its words", "the line before is left alone"])
def test_a_call_gets_no_word(between: str) -> None:
    found = answer(CALL.format(between), "a.mpf")
    assert POCKET in source_lines(found.program)
    cycle = next(one for one in found.lines if one.left_alone == "its feed is part of a cycle")
    assert (cycle.after.feed_mm_min, cycle.after.spindle_rpm) == (cycle.before.feed_mm_min, 5000.0)
    cut = next(one for one in found.lines if one.cut_mm > 0.0 and not one.left_alone)
    assert cut.after.spindle_rpm != 5000.0


APPROACH = (
    KLARTEXT.replace("4 L X+25 Y+30 RL F600 M109", "4 L X-50 Y-40 R0 F500\n5 APPR LT X+25 Y+30 LEN10 RL F600")
    .replace("X0 Y20", "X-60 Y-40")
    .replace("3 L Z0", "3 L Z-1")
)


def test_a_line_that_runs_at_what_another_leaves_has_that_one_left_alone_too() -> None:
    """The first move of APPR has the feed of the block before, the second its own F: no word of APPR gives it both."""
    found = answer(APPROACH, "a.h", force_limit_n=60.0)
    why = {one.line: one.left_alone for one in found.lines}
    assert why[5].startswith("a new F word here would not set its feed")
    assert why[4].startswith("line 6 after it is left alone")
    assert [written for written in source_lines(found.program) if "APPR" in written or "X-50" in written] == [
        "4 L X-50 Y-40 R0 F500",
        "5 APPR LT X+25 Y+30 LEN10 RL F600",
    ]
    assert any("line 5 (block 4): line 6 after it" in note and "line 6 (block 5): a new F word" in note for note in found.notes)
    assert found.after.seconds < found.before.seconds


HOLES = HEAD + "Y35\nG1 X130 F600\nG0 Z50\nS3000 M3 F200\nMCALL CYCLE81(50,6,2,-2)\nX60 Y60\nX70\nMCALL\nM30\n"


def test_holes_of_a_modal_cycle_get_no_words_that_are_in_force_already() -> None:
    written = source_lines(answer(HOLES, "a.mpf").program)
    assert written[-6:] == source_lines(HOLES)[-6:]
    assert written[7] != "G1 X130 F600"


DOWN = "G17 G90 G21\nT1 M6\nS5000 M3\nG0 X-60. Y20. Z60.\nG1 Z{} F400.\nX130. F600.\nG0 Z60.\nM30\n"


@pytest.mark.parametrize(("depth", "is_left"), [("-1.", True), ("50.", False)], ids=["beside the stock", "above it"])
def test_a_feed_down_beside_the_stock_keeps_its_f_word_since_clamps_are_not_described(depth: str, is_left: bool) -> None:
    found = answer(DOWN.format(depth), "a.nc", force_limit_n=60.0)
    line = next(one for one in found.lines if one.line == 4)
    assert (line.left_alone == NEAR) is is_left
    assert (line.after.feed_mm_min == 400.0) is is_left
