"""Q parameters, formulas, FN functions, labels, repeats, calls: what a program computes and where it goes on."""

from dataclasses import replace

import pytest

from tests.twin.programs.klartext.short import all_of, moves_of, program
from twin.errors import PartProgramError
from twin.programs import Settings
from twin.programs.klartext.interpreter import interpret

FORMULAS = {
    # Binding: the two examples of the manual.
    "5 * 3 + 2 * 10": 35.0,
    "SQ 10 - 3^3": 73.0,
    "SQRT 25 + ABS -2": 7.0,
    "-2^2": 4.0,
    "2^3^2": 64.0,
    "(1 + 2) * -3": -9.0,
    "SIN 30 + COS ( 40 + 20 )": 1.0,
    "3 * SIN 90": 3.0,
    "ATAN 1 + ASIN 1 + ACOS 1": 135.0,
    "INT 7.9 + FRAC 1.25": 7.25,
    "NEG 4 + SGN -3": -5.0,
    "10 % 4": 2.0,
    "LN EXP 2 + LOG 1000": 5.0,
    "PI / PI": 1.0,
    "7,5 - .5": 7.0,
}


@pytest.mark.parametrize(("text", "value"), FORMULAS.items(), ids=FORMULAS.keys())
def test_a_formula_is_worth(text: str, value: float) -> None:
    (move,) = interpret(program(f"Q1 = {text}", "L X+Q1 FMAX"))[:1]
    assert move.end_mm[0] == pytest.approx(value)  # type: ignore[union-attr]


FUNCTIONS = {
    "FN 0: Q1 = +60": 60.0,
    "FN 1: Q1 = -Q2 + -5": -15.0,
    "FN 2: Q1 = +10 - +Q2": 0.0,
    "FN 3: Q1 = +3 * +3": 9.0,
    "FN 4: Q1 = +8 DIV +Q2": 0.8,
    "FN 5: Q1 = SQRT 4": 2.0,
    "FN 6: Q1 = SIN-30": -0.5,
    "FN 7: Q1 = COS +60": 0.5,
    "FN 8: Q1 = +3 LEN +4": 5.0,
    "FN 13: Q1 = +25 ANG -25": 135.0,
    "FN0:Q1=+1": 1.0,
    "QL1 = 4": 4.0,
    "QR1 = 4": 4.0,
}


@pytest.mark.parametrize(("block", "value"), FUNCTIONS.items(), ids=FUNCTIONS.keys())
def test_a_function_assigns(block: str, value: float) -> None:
    name = block.partition("=")[0].split(":")[-1].strip()
    (move,) = interpret(program("Q2 = 10", block, f"L X+{name} FMAX"))[:1]
    assert move.end_mm[0] == pytest.approx(value)  # type: ignore[union-attr]


def test_the_control_fills_its_own_parameters() -> None:
    blocks = ["TOOL DEF 3 L+120 R+6", "TOOL CALL 3 Z S500 DR+0.5", "L X+Q108 Y+Q114 Z+0 FMAX M3 M8", "L X+Q110 Y+Q111 FMAX"]
    found = moves_of(*blocks)
    assert found[-1] == "rapid 0 1 120"
    assert "rapid 6.5 120 120" in found


def test_parameters_may_come_from_the_machine() -> None:
    assert moves_of("L X+Q50 Y+QR2 FMAX", settings=Settings(parameters={"Q50": 7.0, "QR2": 8.0})) == ["rapid 7 8 0"]


ORDER: dict[str, tuple[list[str], list[str]]] = {
    "a subprogram": (["CALL LBL 1", "L X+9 FMAX M30", "LBL 1", "L IX+1 FMAX", "LBL 0"], ["1", "9"]),
    "a name": (['CALL LBL "Hole"', "M30", 'LBL "Hole"', "L IX+1 FMAX", "LBL 0"], ["1"]),
    "a section three times over": (["LBL 7", "L IX+1 FMAX", "CALL LBL 7 REP 2/2", "L X+9 FMAX"], ["1", "2", "3", "9"]),
    "repeats by parameter": (["Q1 = 1", "LBL 7", "L IX+1 FMAX", "CALL LBL 7 REP Q1"], ["1", "2"]),
    "repeats in repeats": (
        ["LBL 1", "L IX+1 FMAX", "LBL 2", "L IX+10 FMAX", "CALL LBL 2 REP 1", "CALL LBL 1 REP 1"],
        ["1", "11", "21", "22", "32", "42"],
    ),
    "a subprogram in a subprogram": (
        ["CALL LBL 1", "M30", "LBL 1", "CALL LBL 2", "L IX+1 FMAX", "LBL 0", "LBL 2", "L IX+10 FMAX", "LBL 0"],
        ["10", "11"],
    ),
    "FN 9": (["FN 9: IF +1 EQU +1 GOTO LBL 5", "L X+1 FMAX", "LBL 5", "L X+2 FMAX"], ["2"]),
    "FN 10": (["FN 10: IF +1 NE +1 GOTO LBL 5", "L X+1 FMAX", "LBL 5", "L X+2 FMAX"], ["1", "2"]),
    "FN 11": (["FN 11: IF +2 GT +1 GOTO LBL 5", "L X+1 FMAX", "LBL 5", "L X+2 FMAX"], ["2"]),
    "FN 12": (
        ["Q1 = 0", "LBL 5", "Q1 = Q1 + 1", "L X+Q1 FMAX", "FN 12: IF +Q1 LT +3 GOTO LBL 5"],
        ["1", "2", "3"],
    ),
    "is defined": (["FN 9: IF Q7 IS UNDEFINED GOTO LBL 5", "L X+1 FMAX", "LBL 5", "L X+2 FMAX"], ["2"]),
    "a label by string": (['QS1 = "A"', "CALL LBL QS1", "M30", 'LBL "A"', "L X+4 FMAX", "LBL 0"], ["4"]),
    "END PGM ends like M2": (["L X+1 FMAX"], ["1"]),
    "what is printed or sent is passed over": (["FN 16: F-PRINT TNC:\\A.A / SCREEN:", "FN 15: PRINT 3", "L X+1 FMAX"], ["1"]),
}


@pytest.mark.parametrize(("blocks", "places"), ORDER.values(), ids=ORDER.keys())
def test_blocks_run_in_this_order(blocks: list[str], places: list[str]) -> None:
    rapids = [move.split()[1] for move in all_of(interpret(program(*blocks))) if move.startswith("rapid")]
    assert rapids == places


CALLED = "BEGIN PGM SUB INCH\nQL1 = 3\nQ5 = 2\nL X+Q5 FMAX\nEND PGM SUB INCH"


@pytest.mark.parametrize(
    "call", ["CALL PGM TNC:\\PARTS\\SUB.H", "CALL PGM sub", 'CALL PGM "SUB.H"', "SEL PGM SUB\nCALL SELECTED PGM"]
)
def test_another_program_has_its_own_unit_and_local_parameters(call: str) -> None:
    settings = Settings(programs={"sub": CALLED})
    found = interpret(program("QL1 = 9", *call.split("\n"), "L X+QL1 Y+Q5 FMAX"), settings)
    assert all_of(found) == ["rapid 50.8 0 0", "rapid 9 2 0", "end"]
    assert [(move.line, move.program) for move in found][:2] == [
        (3, "SUB" if "SUB" in call else "sub"),
        (3 + call.count("\n"), None),
    ]


def test_cycle_12_makes_a_program_of_a_cycle() -> None:
    settings = Settings(programs={"sub": CALLED.replace("INCH", "MM")})
    found = all_of(interpret(program("CYCL DEF 12.0 PGM CALL", "CYCL DEF 12.1 PGM TNC:\\SUB.H", "L Y+1 FMAX M99"), settings))
    assert found == ["rapid 0 1 0", "rapid 2 1 0", "end"]


REFUSED = {
    "a parameter without a value": (["L X+Q5 FMAX"], 2, "Q5", "has no value yet"),
    "a label that is not there": (["CALL LBL 9"], 2, "CALL LBL 9", "no LBL 9"),
    "a jump to a label that is not there": (["FN 9: IF +0 EQU +0 GOTO LBL 9"], 2, "FN 9", "no LBL 9"),
    "division by zero": (["Q1 = 1 / 0"], 2, "/", "division by zero"),
    "DIV by zero": (["FN 4: Q1 = +1 DIV +0"], 2, "DIV", "division by zero"),
    "a root of nothing": (["Q1 = SQRT -1"], 2, "SQRT", "has no value at -1"),
    "too large": (["Q1 = 10 ^ 999"], 2, "^", "too large"),
    "a formula that stops": (["Q1 = 3 +"], 2, "", "ends inside a formula"),
    "a formula that goes on": (["Q1 = 3 4"], 2, "4", "an operator"),
    "a wrong operator": (["FN 1: Q1 = +3 * +4"], 2, "+3 * +4", "is not what FN 1 takes"),
    "a condition of another number": (["FN 9: IF +1 GT +2 GOTO LBL 1"], 2, "FN 9", "is written FN 9"),
    "the program's own error": (["FN 14: ERROR = 1000"], 2, "FN 14", "its own error here: ERROR = 1000"),
    "system data": (["FN 18: SYSREAD Q1 = ID20 NR1"], 2, "FN 18", "reads system data"),
    "a string in a figure": (['QS1 = "5"', "L X+QS1 FMAX"], 3, "X+QS1", "string parameter"),
    "a program that is not at hand": (["CALL PGM OTHER"], 2, "OTHER", "no program OTHER"),
    "a parameter that does not exist": (["Q2000 = 1"], 2, "Q2000", "no such parameter"),
    "a subprogram without an end": (["CALL LBL 1", "M30", "LBL 1", "L X+1 FMAX"], 5, "", ""),
}


@pytest.mark.parametrize(("blocks", "line", "word", "reason"), REFUSED.values(), ids=REFUSED.keys())
def test_what_cannot_be_computed_is_refused(blocks: list[str], line: int, word: str, reason: str) -> None:
    if blocks[0] == "CALL LBL 1":
        text = program(*blocks).rpartition("\n")[0]
        reason = "ends without LBL 0"
    else:
        text = program(*blocks)
    with pytest.raises(PartProgramError) as caught:
        interpret(text)
    assert (caught.value.line, caught.value.word) == (line, word)
    assert reason in caught.value.reason


def test_m30_in_a_called_program_is_refused() -> None:
    settings = Settings(programs={"sub": "BEGIN PGM SUB MM\nM30\nEND PGM SUB MM"})
    with pytest.raises(PartProgramError, match="SUB, line 2: M30: cannot stand in a program that CALL PGM calls"):
        interpret(program("CALL PGM SUB"), settings)


ENDLESS = {
    "a jump back": ["LBL 1", "FN 9: IF +0 EQU +0 GOTO LBL 1"],
    "a subprogram of itself": ["LBL 1", "CALL LBL 1"],
    "a program of itself": ["CALL PGM SELF"],
    "repeats without end": ["LBL 1", "LBL 2", "CALL LBL 2 REP 99", "CALL LBL 1 REP 9999"],
}


@pytest.mark.parametrize("blocks", ENDLESS.values(), ids=ENDLESS.keys())
def test_a_program_without_an_end_is_an_error(blocks: list[str]) -> None:
    settings = Settings(jumps_max=500, programs={"self": program("CALL PGM SELF")})
    with pytest.raises(PartProgramError, match=r"the program has no end|Settings\.call_depth_max"):
        interpret(program(*blocks), settings)
    few = replace(settings, jumps_max=10_000_000, call_depth_max=15, blocks_max=2000)
    with pytest.raises(PartProgramError, match=r"Settings\.(blocks_max|call_depth_max)"):
        interpret(program(*blocks), few)
