"""The path functions, each block with the moves that it makes, worked out by hand."""

import pytest

from tests.twin.programs.klartext.short import moves_of, program
from twin.programs import Settings
from twin.programs.klartext.interpreter import interpret

CASES = {
    "absolute": (["L X+10 Y-5,5 F500"], ["line 10 -5.5 0 F500"]),
    "an axis that is not named stays": (["L X+10 F500", "L Y+3"], ["line 10 0 0 F500", "line 10 3 0 F500"]),
    "incremental": (["L X+10 F500", "L IX-2.5 IY+4 Z+1"], ["line 10 0 0 F500", "line 7.5 4 1 F500"]),
    "FMAX holds in its block alone": (
        ["L X+1 F200", "L X+2 FMAX", "L X+3"],
        ["line 1 0 0 F200", "rapid 2 0 0", "line 3 0 0 F200"],
    ),
    "F MAX is FMAX": (["L X+2 R0 F MAX"], ["rapid 2 0 0"]),
    "a feed by parameter": (["Q5 = 350", "L X+Q5 FQ5"], ["line 350 0 0 F350"]),
    "block numbers, comments, structure": (["12 L X+1 F10 ; L X+2", "13 * - L X+3", "14 ; L X+4"], ["line 1 0 0 F10"]),
    "small letters": (["l x+1 y+2 r0 f100"], ["line 1 2 0 F100"]),
    "a circle about CC": (
        ["CC X+10 Y+0", "L X+0 F100", "C X+20 Y+0 DR-"],
        ["line 0 0 0 F100", "arc 20 0 0 about 10 0 sweep -180 F100"],
    ),
    "a full circle": (["CC X+10 Y+0", "C X+0 Y+0 DR+ F100"], ["arc 0 0 0 about 10 0 sweep 360 F100"]),
    "CC alone is where the tool is": (["L X+10 F100", "CC", "LP PR+5 PA+90"], ["line 10 0 0 F100", "line 10 5 0 F100"]),
    "CC incremental": (
        ["L X+10 F100", "CC IX+5 IY+0", "C X+20 DR+"],
        ["line 10 0 0 F100", "arc 20 0 0 about 15 0 sweep 180 F100"],
    ),
    "CC keeps a coordinate": (["CC X+5 Y+5", "CC X+10", "LP PR+1 PA+0 F1"], ["line 11 5 0 F1"]),
    "CR short": (["CR X+10 Y+10 R+10 DR+ F100"], ["arc 10 10 0 about 0 10 sweep 90 F100"]),
    "CR long": (["CR X+10 Y+10 R-10 DR+ F100"], ["arc 10 10 0 about 10 0 sweep 270 F100"]),
    "CT goes on in the direction before": (
        ["L X+10 F100", "CT X+20 Y+10"],
        ["line 10 0 0 F100", "arc 20 10 0 about 10 10 sweep 90 F100"],
    ),
    "CT behind an arc": (
        ["CC X+0 Y+10", "C X+10 Y+10 DR+ F50", "CT X+20 Y+20"],
        ["arc 10 10 0 about 0 10 sweep 90 F50", "arc 20 20 0 about 20 10 sweep -90 F50"],
    ),
    "CT of more than half a turn": (
        ["L X+10 F100", "CT X+0 Y+10"],
        ["line 10 0 0 F100", "arc 0 10 0 about 10 10 sweep 270 F100"],
    ),
    "CTP": (["CC X+10 Y+0", "L X+10 F100", "CTP PR+10 PA+90"], ["line 10 0 0 F100", "arc 10 10 0 about 10 5 sweep 180 F100"]),
    "polar": (
        ["CC X+50 Y+50", "LP PR+20 PA+0 F100", "LP PA+90", "LP IPA+90", "LP IPR+5"],
        ["line 70 50 0 F100", "line 50 70 0 F100", "line 30 50 0 F100", "line 25 50 0 F100"],
    ),
    "CP": (["CC X+10 Y+0", "CP PA+90 DR- F100"], ["arc 10 10 0 about 10 0 sweep -90 F100"]),
    "a helix": (["CC X+10 Y+0", "CP IPA+720 IZ-4 DR+ F100"], ["arc 0 0 -4 about 10 0 sweep 720 F100"]),
    "an arc with its own straight axis": (
        ["CC X+10 Y+0", "C X+20 Y+0 LIN_Z-3 DR+ F100"],
        ["arc 20 0 -3 about 10 0 sweep 180 F100"],
    ),
    "a circle out of the working plane": (
        ["L X+10 Z+5 F100", "CC X+10 Z+0", "CP IPA+90 DR+"],
        ["line 10 0 5 F100", "arc 15 0 0 about 0 10 sweep 90 F100 G18"],
    ),
    "a rounding": (
        ["L X+10 F100", "RND R4", "L Y+10"],
        ["line 6 0 0 F100", "arc 10 4 0 about 6 4 sweep 90 F100", "line 10 10 0 F100"],
    ),
    "a rounding with a feed of its own": (
        ["L X+10 F100", "RND R4 F30", "L Y+10"],
        ["line 6 0 0 F100", "arc 10 4 0 about 6 4 sweep 90 F30", "line 10 10 0 F100"],
    ),
    "a rounding without R": (
        ["L X+10 F100", "RND 4", "L Y+10"],
        ["line 6 0 0 F100", "arc 10 4 0 about 6 4 sweep 90 F100", "line 10 10 0 F100"],
    ),
    "a chamfer": (["L X+10 F100", "CHF 3 F20", "L Y+10"], ["line 7 0 0 F100", "line 10 3 0 F20", "line 10 10 0 F100"]),
    "a chamfer by parameter": (
        ["Q1 = 3", "L X+10 F100", "CHF Q1", "L Y+10"],
        ["line 7 0 0 F100", "line 10 3 0 F100", "line 10 10 0 F100"],
    ),
    "coolant between a move and its corner": (
        ["L X+10 F100 M9", "CHF 3", "L Y+10"],
        ["line 7 0 0 F100", "line 10 3 0 F100", "coolant off", "line 10 10 0 F100"],
    ),
    "in machine coordinates": (
        ["CYCL DEF 7.0 DATUM SHIFT", "CYCL DEF 7.1 X+5", "L X+10 F100", "L X+10 M91"],
        ["line 15 0 0 F100", "line 10 0 0 F100"],
    ),
    "back along the tool's axis": (
        ["L Z-5 F100", "L M140 MB50 F750", "L M140 MB+10"],
        ["line 0 0 -5 F100", "line 0 0 45 F750", "rapid 0 0 55"],
    ),
    "a feed per revolution": (["TOOL CALL 1 Z S1000", "L X+1 FU0.2 M3"], ["tool 1", "spindle 1000", "line 1 0 0 F200 per 0.2"]),
    "F AUTO is that of TOOL CALL": (
        ["TOOL CALL 1 Z S1000 F450", "L X+1 F100", "L X+2 F AUTO"],
        ["tool 1", "line 1 0 0 F100", "line 2 0 0 F450"],
    ),
}


@pytest.mark.parametrize(("blocks", "moves"), CASES.values(), ids=CASES.keys())
def test_a_block_makes_these_moves(blocks: list[str], moves: list[str]) -> None:
    assert moves_of(*blocks) == moves


def test_the_line_of_a_move_is_that_of_its_block() -> None:
    found = interpret("0 BEGIN PGM A MM\n\n1 L X+1 F10\n2 ; nothing\n3 L X+2\n4 END PGM A MM")
    assert [move.line for move in found] == [2, 4, 5]


def test_an_inch_program_counts_inches_and_tenths_of_an_inch_a_minute() -> None:
    assert moves_of("L X+1 F100", "L IX+1", unit="INCH") == ["line 25.4 0 0 F254", "line 50.8 0 0 F254"]


def test_plunging_is_held_back_by_m103() -> None:
    """The example of the manual: F500, M103 F20 (User's Manual iTNC 530, "Feed rate factor for plunging movements M103")."""
    blocks = ["L X+20 Y+20 F500 M103 F20", "L Y+50", "L IZ-2.5", "L IY+5 IZ-5", "L IX+50", "L Z+5"]
    feeds = [move.rpartition("F")[2] for move in moves_of(*blocks)]
    assert feeds == ["500", "500", "100", "141.421", "500", "500"]


def test_a_rotary_axis_takes_the_shortest_way_with_m126() -> None:
    settings = Settings(axes=("x", "y", "z", "c"), start_mm=(0.0, 0.0, 0.0, 350.0))
    assert moves_of("L C+10 FMAX", settings=settings) == ["rapid 0 0 0 10"]
    assert moves_of("M126", "L C+10 FMAX", settings=settings) == ["rapid 0 0 0 370"]


@pytest.mark.parametrize("depth", [0, 1])
def test_a_skipped_block_depends_on_its_switch(depth: int) -> None:
    settings = Settings(block_skip=frozenset({1} if depth else ()))
    assert len(interpret(program("/ L X+5 FMAX"), settings)) == 2 - depth
