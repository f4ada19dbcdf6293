"""Cycles that move and turn the coordinates, tools, M functions, special cycles."""

import pytest

from tests.twin.programs.klartext.short import moves_of, program
from twin.errors import PartProgramError
from twin.programs import Settings, ToolOffset
from twin.programs.klartext.interpreter import interpret

PRESETS = Settings(work_offsets_mm={"preset 1": (1.0, 2.0, 3.0), "preset 4": (40.0, 0.0, 0.0), "datum 5": (0.0, 7.0, 0.0)})
FRAMES: dict[str, tuple[list[str], list[str]]] = {
    "the first preset is in force": ([], ["rapid 11 22 3"]),
    "247": (["CYCL DEF 247 DATUM SETTING ~", "  Q339=+4 ;NUMBER"], ["rapid 50 20 0"]),
    "7": (["CYCL DEF 7.0 DATUM SHIFT", "CYCL DEF 7.1 X+100", "CYCL DEF 7.2 IY+5"], ["rapid 111 27 3"]),
    "7 adds up by increments": (["CYCL DEF 7.0 NULLPUNKT", "CYCL DEF 7.1 X+1 Y+1", "CYCL DEF 7.1 IX+1"], ["rapid 13 23 3"]),
    "7 from the table": (["CYCL DEF 7.0 DATUM SHIFT", "CYCL DEF 7.1 #5"], ["rapid 11 29 3"]),
    "TRANS DATUM": (["TRANS DATUM AXIS X+100 Z+1"], ["rapid 111 22 4"]),
    "TRANS DATUM RESET": (["TRANS DATUM AXIS X+100", "TRANS DATUM RESET"], ["rapid 11 22 3"]),
    "8": (["CYCL DEF 8.0 MIRROR IMAGE", "CYCL DEF 8.1 X Y"], ["rapid -9 -18 3"]),
    "8 off": (["CYCL DEF 8.0 SPIEGELN", "CYCL DEF 8.1 X", "CYCL DEF 8.0 SPIEGELN", "CYCL DEF 8.1"], ["rapid 11 22 3"]),
    "10": (["CYCL DEF 10.0 ROTATION", "CYCL DEF 10.1 ROT+90"], ["rapid -19 12 3"]),
    "10 by increments": (["CYCL DEF 10.0 ROTATION", "CYCL DEF 10.1 IROT+45", "CYCL DEF 10.1 IROT+45"], ["rapid -19 12 3"]),
    "11": (["CYCL DEF 11.0 SCALING", "CYCL DEF 11.1 SCL 0.5"], ["rapid 6 12 3"]),
    "26": (["CYCL DEF 26.0 AXIS-SPEC. SCALING", "CYCL DEF 26.1 X2 Y0.5 CCX+10 CCY+0"], ["rapid 11 12 3"]),
    "shift, rotation and mirror": (
        ["CYCL DEF 7.1 X+5", "CYCL DEF 8.1 Y", "CYCL DEF 10.1 ROT+90"],
        ["rapid -14 -8 3"],
    ),
}


@pytest.mark.parametrize(("blocks", "moves"), FRAMES.values(), ids=FRAMES.keys())
def test_the_same_place_elsewhere(blocks: list[str], moves: list[str]) -> None:
    """X10 Y20 Z0, with preset 1 in force unless the blocks say otherwise."""
    assert moves_of(*blocks, "L X+10 Y+20 Z+0 R0 FMAX", settings=PRESETS) == moves


def test_an_arc_turns_over_in_a_mirror() -> None:
    found = moves_of("CYCL DEF 8.0 MIRROR IMAGE", "CYCL DEF 8.1 X", "CR X+10 Y+10 R+10 DR+ F100")
    assert found == ["arc -10 10 0 about 0 10 sweep -90 F100"]


def test_scaling_scales_radii() -> None:
    blocks = ["CYCL DEF 11.1 SCL 2", "CR X+10 Y+10 R+10 DR+ F100", "L Y+20", "RND R1", "L X+20"]
    assert moves_of(*blocks) == [
        "arc 20 20 0 about 0 20 sweep 90 F100",
        "line 20 38 0 F100",
        "arc 22 40 0 about 22 38 sweep -90 F100",
        "line 40 40 0 F100",
    ]


TABLE = Settings(tool_offsets={1: ToolOffset(100.0, 5.0), 7: ToolOffset(80.0, 3.0)}, tool_numbers={"DRILL_6": 7})
TOOLS: dict[str, tuple[list[str], list[str]]] = {
    "length with the next move of the axis": (
        ["TOOL CALL 1 Z S500", "L X+5 FMAX", "L Z+10 FMAX"],
        ["tool 1", "rapid 5 0 0", "length 100", "rapid 5 0 110"],
    ),
    "by name, with a delta": (['TOOL CALL "DRILL_6" Z S500 DL+0.5', "L Z+10 FMAX"], ["tool 7", "length 80.5", "rapid 0 0 90.5"]),
    "by parameter": (["Q1 = 7", "TOOL CALL Q1 Z S500"], ["tool 7"]),
    "by a string": (['QS1 = "DRILL_6"', "TOOL CALL QS1 Z S500"], ["tool 7"]),
    "indexed": (["TOOL CALL 7.1 Z S500"], ["tool 7"]),
    "the speed alone": (["TOOL CALL 1 Z S500", "M3", "TOOL CALL S800"], ["tool 1", "spindle 500", "spindle 800"]),
    "the spindle stands for a change": (
        ["TOOL CALL 1 Z S500", "M3", "TOOL CALL 7 Z S800", "M4"],
        ["tool 1", "spindle 500", "spindle 0", "tool 7", "spindle -800"],
    ),
    "TOOL DEF only brings it near": (["TOOL DEF 7", "TOOL CALL 1 Z S500 DR2+0.1"], ["tool 1"]),
    "no tool": (["TOOL CALL 1 Z S500", "TOOL CALL 0 Z"], ["tool 1", "tool 0"]),
    "an axis without a tool": (["TOOL CALL Z"], []),
}


@pytest.mark.parametrize(("blocks", "moves"), TOOLS.values(), ids=TOOLS.keys())
def test_tool_call_takes_the_tool(blocks: list[str], moves: list[str]) -> None:
    assert moves_of(*blocks, settings=TABLE) == moves


FUNCTIONS: dict[str, tuple[list[str], list[str]]] = {
    "M3 before, M5 behind its move": (
        ["TOOL CALL 1 Z S500", "L X+1 FMAX M3", "L X+2 FMAX M5"],
        ["tool 1", "spindle 500", "rapid 1 0 0", "rapid 2 0 0", "spindle 0"],
    ),
    "M13, M14": (["TOOL CALL 1 Z S500", "M13", "M14"], ["tool 1", "spindle 500", "coolant on", "spindle -500", "coolant on"]),
    "M8, M9": (["L X+1 FMAX M8", "L X+2 FMAX M9"], ["coolant on", "rapid 1 0 0", "rapid 2 0 0", "coolant off"]),
    "M0": (["L X+1 FMAX M0"], ["rapid 1 0 0", "stop"]),
    "M1 without its switch": (["L X+1 FMAX M1"], ["rapid 1 0 0"]),
    "STOP": (["STOP M8", "STOP"], ["coolant on", "stop", "stop"]),
    "the machine builder's": (["L X+1 FMAX M55"], ["rapid 1 0 0"]),
    "dwell": (["CYCL DEF 9.0 DWELL TIME", "CYCL DEF 9.1 DWELL 1.5", "FUNCTION DWELL TIME2"], ["dwell 1.5", "dwell 2"]),
    "dwell in German": (["CYCL DEF 9.1 V.ZEIT 0,5"], ["dwell 0.5"]),
    "orientation": (["CYCL DEF 13.0 ORIENTATION", "CYCL DEF 13.1 ANGLE 180"], ["orient"]),
    "tolerance": (
        ["CYCL DEF 32.0 TOLERANCE", "CYCL DEF 32.1 T0.05", "CYCL DEF 32.2 HSC-MODE:1 TA0.5"],
        ["tolerance 0.05 None", "tolerance 0.05 0.5"],
    ),
    "the machine's tolerance": (["CYCL DEF 32.0 TOLERANZ", "CYCL DEF 32.1", "CYCL DEF 32.2"], ["tolerance None None"]),
    "blank and switches back": (["BLK FORM 0.1 Z X+0 Y+0 Z-20", "PLANE RESET STAY", "FUNCTION RESET TCPM", "M129"], []),
    "retract to the end of the axis": (["L Z-5 FMAX", "L M140 MB MAX"], ["rapid 0 0 -5", "rapid 0 0 400"]),
}


@pytest.mark.parametrize(("blocks", "moves"), FUNCTIONS.values(), ids=FUNCTIONS.keys())
def test_a_function_does_this(blocks: list[str], moves: list[str]) -> None:
    settings = Settings(builder_m_codes=frozenset({55}), references_mm=((0.0, 0.0, 400.0),))
    assert moves_of(*blocks, settings=settings) == moves


REFUSED = {
    "a feed that is missing": ("L X+5", "", "has no feed"),
    "M128": ("L X+5 F100 M128", "M128", "kinematics"),
    "M97": ("L X+5 F100 M97", "M97", "smaller tool"),
    "an M code that nobody knows": ("L X+5 F100 M777", "M777", "builder_m_codes"),
    "an axis that is not there": ("L B+5 F100", "B+5", "has no axis B"),
    "an axis twice": ("L X+5 IX+3 F100", "IX+3", "twice"),
    "a word twice": ("L X+5 X+3 F100", "X+3", "twice"),
    "a word that means nothing": ("L X+5 P3 F100", "P3", "no meaning"),
    "something else": ("L X+5 # F100", "#", "not read here"),
    "a feed of teeth": ("L X+5 FZ0.1", "FZ0.1", "teeth"),
    "a feed of nothing": ("L X+5 F0", "F0", "more than 0"),
    "F AUTO without TOOL CALL": ("L X+5 F AUTO", "F AUTO", "gave no feed"),
    "an arc in rapid": ("CR X+5 R+5 DR+ FMAX", "FMAX", "along an arc"),
    "an arc without its sense": ("CR X+5 R+5 F100", "", "DR+ or DR-"),
    "an arc too short": ("CR X+50 R+5 DR+ F100", "R+5", "more than the diameter"),
    "no pole": ("LP PR+5 PA+0 F100", "", "write CC before"),
    "CT at the start": ("CT X+5 Y+5 F100", "CT", "tangential"),
    "free contours": ("FL X+5", "FL", "FK"),
    "a tilted plane": ("PLANE SPATIAL SPA+0 SPB+45 SPC+0 STAY", "PLANE", "tilted"),
    "cycle 19": ("CYCL DEF 19.0 WORKING PLANE", "CYCL DEF 19.0", "tilted"),
    "SL cycles": ("CYCL DEF 14.0 CONTOUR", "CYCL DEF 14.0", "SL"),
    "a probe": ("TCH PROBE 412 DATUM Q321=+50", "TCH PROBE", "probing"),
    "an old cycle": ("CYCL DEF 1.0 PECKING", "CYCL DEF 1.0", "is not read"),
    "an ISO block": ("G01 X5 F100", "G01 X5", "is not read"),
    "nonsense": ("§17 ?nonsense?", "§17 ?nonsense?", "is not read"),
    "a preset that is not there": ("CYCL DEF 247 Q339=+9", "Q339", "no line 9"),
    "a datum that is not there": ("CYCL DEF 7.1 #9", "#9", "no such line"),
    "letters among the figures of a feed": ("L X+5 R0 F3OO M3", "F3OO", "is not read"),
    "a letter in a coordinate": ("L X+1O Z-5", "X+1O", "is not read"),
    "an end that is not on the circle": ("CC X+10 Y+0\nC X+30 Y+2 DR+ F100", "", "correct CC or the end"),
    "a circle about its start": ("L X+0 Y+0 F100\nCC X+0 Y+0\nC X+30 Y+2 DR+", "", "correct CC or the start"),
    "a tool that nobody named": ('TOOL CALL "X" Z', '"X"', "tool_numbers"),
    "a rotation without an angle": ("CYCL DEF 10.1 TURN", "TURN", "ROT+30"),
    "a corner at the end": ("L X+5 F100\nRND R2", "RND R2", "program ends"),
}


@pytest.mark.parametrize(("blocks", "word", "reason"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_not_read_is_named(blocks: str, word: str, reason: str) -> None:
    with pytest.raises(PartProgramError) as caught:
        interpret(program(*blocks.split("\n")), PRESETS)
    assert caught.value.word == word
    assert reason in caught.value.reason
    assert caught.value.line >= 2


def test_an_angle_has_the_sign_of_its_sense() -> None:
    with pytest.raises(PartProgramError, match=r"line 3: IPA\+90: IPA and DR"):
        interpret(program("CC X+5 Y+0", "CP IPA+90 DR- F100"))


def test_without_its_reference_an_axis_has_no_end() -> None:
    with pytest.raises(PartProgramError, match=r"line 2: M140: .*references_mm"):
        interpret(program("L M140 MB MAX"))
