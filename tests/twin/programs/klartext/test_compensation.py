"""R0, RL, RR, APPR and DEP with a tool of radius 5, worked out by hand."""

import pytest

from tests.twin.programs.klartext.short import TOOL_5, moves_of, program
from twin.errors import PartProgramError
from twin.programs.klartext.interpreter import interpret

TOOL = "TOOL CALL 1 Z S1000"
START = [TOOL, "L X-20 Y+0 R0 FMAX"]
HERE = ["tool 1", "rapid -20 0 0"]
CASES: dict[str, tuple[list[str], list[str]]] = {
    "on and off square to the contour": (
        ["L X+0 Y+0 RL F100", "L X+50", "L X+70 Y-20 R0"],
        ["line 0 5 0 F100", "line 50 5 0 F100", "line 70 -20 0 F100"],
    ),
    "to the right": (
        ["L X+0 Y+0 RR F100", "L X+50", "L Y-20 R0"],
        ["line 0 -5 0 F100", "line 50 -5 0 F100", "line 50 -20 0 F100"],
    ),
    "an outside corner on an arc": (
        ["L X+0 Y+0 RL F100", "L X+50", "L Y-50", "L X+70 R0"],
        [
            "line 0 5 0 F100",
            "line 50 5 0 F100",
            "arc 55 0 0 about 50 0 sweep -90 F100",
            "line 55 -50 0 F100",
            "line 70 -50 0 F100",
        ],
    ),
    "an inside corner where the parallels cross": (
        ["L X+0 Y+0 RL F100", "L X+50", "L Y+50", "L X+70 R0"],
        ["line 0 5 0 F100", "line 45 5 0 F100", "line 45 50 0 F100", "line 70 50 0 F100"],
    ),
    "R0 with the tool's axis alone stays beside": (
        ["L X+0 Y+0 RL F100", "L X+50", "L Z+10 R0 FMAX", "L X+70 Y+0"],
        ["line 0 5 0 F100", "line 50 5 0 F100", "rapid 50 5 10", "line 70 0 10 F100"],
    ),
    "a mirror turns the side over": (
        ["CYCL DEF 8.0 MIRROR IMAGE", "CYCL DEF 8.1 Y", "L X+0 Y+0 RL F100", "L X+50", "L Y+50", "L X+70 R0"],
        ["line 0 -5 0 F100", "line 45 -5 0 F100", "line 45 -50 0 F100", "line 70 -50 0 F100"],
    ),
    "the radius has the delta of TOOL CALL in": (
        ["TOOL CALL 1 Z S1000 DR+1", "L X+0 Y+0 RL F100", "L X+50", "L Y+20 R0"],
        ["line 0 6 0 F100", "line 50 6 0 F100", "line 50 20 0 F100"],
    ),
    "APPR LT and DEP LT": (
        ["APPR LT X+0 Y+0 LEN10 RL F100", "L X+50", "DEP LT LEN8 F300"],
        ["rapid -10 5 0", "line 0 5 0 F100", "line 50 5 0 F100", "line 58 5 0 F300"],
    ),
    "APPR LN and DEP LN": (
        ["APPR LN X+0 Y+0 LEN10 RL F100", "L X+50", "DEP LN LEN+8"],
        ["rapid 0 15 0", "line 0 5 0 F100", "line 50 5 0 F100", "line 50 13 0 F100"],
    ),
    "APPR CT and DEP CT": (
        ["APPR CT X+0 Y+0 CCA90 R+10 RL F100", "L X+50", "DEP CT CCA90 R+10"],
        [
            "rapid -10 15 0",
            "arc 0 5 0 about 0 15 sweep 90 F100",
            "line 50 5 0 F100",
            "arc 60 15 0 about 50 15 sweep 90 F100",
        ],
    ),
    "APPR CT with a negative radius": (
        ["APPR CT X+0 Y+0 CCA90 R-10 RL F100", "L X+50", "L Y+20 R0"],
        ["rapid -10 -5 0", "arc 0 5 0 about 0 -5 sweep -90 F100", "line 50 5 0 F100", "line 50 20 0 F100"],
    ),
    "APPR CT on the right": (
        ["APPR CT X+0 Y+0 CCA180 R+10 RR F100", "L X+50", "DEP CT CCA90 R+10"],
        [
            "rapid 0 -25 0",
            "arc 0 -5 0 about 0 -15 sweep -180 F100",
            "line 50 -5 0 F100",
            "arc 60 -15 0 about 50 -15 sweep -90 F100",
        ],
    ),
    "APPR goes down at its auxiliary point": (
        ["L Z+2 F500", "APPR LT X+0 Y+0 Z-10 LEN10 RL F100", "L X+50", "DEP LT LEN5 Z+2 FMAX"],
        [
            "line -20 0 2 F500",
            "line -10 5 2 F500",
            "line -10 5 -10 F100",
            "line 0 5 -10 F100",
            "line 50 5 -10 F100",
            "rapid 55 5 -10",
            "rapid 55 5 2",
        ],
    ),
    "APPR LT without a side": (
        ["APPR LT X+0 Y+0 LEN10 R0 F100", "L X+50", "L Y+50", "DEP LT LEN5"],
        ["rapid -10 0 0", "line 0 0 0 F100", "line 50 0 0 F100", "line 50 50 0 F100", "line 50 55 0 F100"],
    ),
    "APPR LCT touches the line and the contour": (
        ["L X-10 Y+30 FMAX", "APPR LCT X+0 Y+0 R10 RL F100", "L X+50", "DEP LCT X+60 Y+30 R10 F300"],
        [
            "rapid -10 30 0",
            "line -10 15 0 F100",
            "arc 0 5 0 about 0 15 sweep 90 F100",
            "line 50 5 0 F100",
            "arc 60 15 0 about 50 15 sweep 90 F300",
            "line 60 30 0 F300",
        ],
    ),
    "the feed of the cutting edge in arcs": (
        [
            "L X+0 Y+0 RL F100 M109",
            "CR X+20 Y+20 R+20 DR+",
            "CR X+30 Y+30 R+10 DR-",
            "M110",
            "CR X+40 Y+20 R+10 DR-",
            "L Y-20 R0",
        ],
        [
            "line 0 5 0 F100",
            "arc 15 20 0 about 0 20 sweep 90 F75",
            "arc 30 35 0 about 30 20 sweep -90 F150",
            "arc 45 20 0 about 30 20 sweep -90 F100",
            "line 40 -20 0 F100",
        ],
    ),
    "an inner corner left open": (
        ["L X+0 Y+0 RL F100", "L X+50 M98", "L Y+50", "L X+70 R0"],
        ["line 0 5 0 F100", "line 50 5 0 F100", "line 45 0 0 F100", "line 45 50 0 F100", "line 70 50 0 F100"],
    ),
    "down between APPR and its contour": (
        ["APPR LT X+0 Y+0 LEN10 RL F100", "L Z-3 M8", "L X+50", "DEP LT LEN8"],
        ["rapid -10 5 0", "line 0 5 0 F100", "coolant on", "line 0 5 -3 F100", "line 50 5 -3 F100", "line 58 5 -3 F100"],
    ),
    "RND in a compensated contour": (
        ["L X+0 Y+0 RL F100", "L X+50", "RND R8 F40", "L Y+50", "L X+70 R0"],
        ["line 0 5 0 F100", "line 42 5 0 F100", "arc 45 8 0 about 42 8 sweep 90 F40", "line 45 50 0 F100", "line 70 50 0 F100"],
    ),
}


@pytest.mark.parametrize(("blocks", "moves"), CASES.values(), ids=CASES.keys())
def test_the_tool_goes_beside_its_path(blocks: list[str], moves: list[str]) -> None:
    assert moves_of(*START, *blocks, settings=TOOL_5) == [*HERE, *moves]


REFUSED: dict[str, tuple[list[str], int, str, str]] = {
    "from one side to the other": (["L X+0 Y+0 RL F100", "L X+50", "L X+60 RR"], 6, "RR", "R0 between"),
    "a radius that does not fit": (["CC X+0 Y+3", "L X+0 Y+0 RL F100", "C X+0 Y+0 DR+", "L X+5 Y+5 R0"], 6, "", "does not fit"),
    "a tool call on the contour": (["L X+0 Y+0 RL F100", "L X+50", TOOL], 6, "TOOL CALL", "between RL or RR and R0"),
    "a cycle on the contour": (
        ["CYCL DEF 247 Q339=1", "L X+0 RL F100", "L X+50", "CYCL DEF 7.0 DATUM"],
        7,
        "CYCL DEF 7",
        "RL or RR",
    ),
    "APPR without a contour": (["APPR LT X+0 Y+0 LEN10 RL F100", "DEP LT LEN8"], 4, "APPR", "needs a contour"),
    "DEP without a contour": (["L Z-3 F100", "DEP LT LEN8"], 5, "DEP", "just before it"),
    "APPR LCT too near": (["APPR LCT X-20 Y-10 R10 RL F100", "L X+50", "L Y+20 R0"], 4, "APPR", "start further away"),
    "APPR without its length": (["APPR LT X+0 Y+0 RL F100"], 4, "APPR", "needs LEN"),
    "APPR CT without its angle": (["APPR CT X+0 Y+0 R5 RL F100"], 4, "APPR", "needs CCA"),
    "a corner too large": (["L X+0 F100", "RND R50", "L Y+20"], 5, "RND R50", "do not fit"),
}


@pytest.mark.parametrize(("blocks", "line", "word", "reason"), REFUSED.values(), ids=REFUSED.keys())
def test_what_the_control_refuses_is_refused(blocks: list[str], line: int, word: str, reason: str) -> None:
    with pytest.raises(PartProgramError) as caught:
        interpret(program(*START, *blocks), TOOL_5)
    assert (caught.value.word, reason in caught.value.reason) == (word, True), str(caught.value)
    assert caught.value.line == line


def test_without_a_table_of_tools_a_radius_is_not_invented() -> None:
    with pytest.raises(PartProgramError, match="line 3: RL: the tool's radius is not known"):
        interpret(program(TOOL, "L X+0 Y+0 RL F100"))
