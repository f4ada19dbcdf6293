"""The drilling, boring and tapping cycles, worked out by hand from the descriptions of Cycle Programming TNC 640."""

import pytest

from tests.twin.programs.klartext.short import moves_of, program
from twin.errors import PartProgramError
from twin.programs.klartext.interpreter import interpret

BEFORE = ["TOOL CALL 1 Z S500", "L X+10 Y+20 Z+50 R0 FMAX M3"]
MADE = ["tool 1", "spindle 500", "rapid 10 20 50"]
COMMON = {200: "2", 201: "-20", 203: "+0", 204: "50", 206: "150"}
UP = ["rapid 10 20 2", "rapid 10 20 50"]


def cycle(number: int, **changed: str) -> list[str]:
    """A definition with its call."""
    values = {**COMMON, **{int(name[1:]): value for name, value in changed.items()}}
    return [f"CYCL DEF {number} NAME", *(f"    Q{one}={value} ;TEXT" for one, value in values.items()), "CYCL CALL"]


CASES: dict[str, tuple[list[str], list[str]]] = {
    "200 in one": (cycle(200, Q202="20"), ["rapid 10 20 2", "line 10 20 -20 F150", *UP]),
    "200 in plunges, with pauses": (
        cycle(200, Q202="12", Q210="0.5", Q211="1"),
        [
            "rapid 10 20 2",
            "line 10 20 -12 F150",
            "rapid 10 20 2",
            "dwell 0.5",
            "rapid 10 20 -10",
            "line 10 20 -20 F150",
            "dwell 1",
            *UP,
        ],
    ),
    "200 without a second clearance": (
        cycle(200, Q202="20", Q204="0"),
        ["rapid 10 20 2", "line 10 20 -20 F150", "rapid 10 20 2"],
    ),
    "201": (
        cycle(201, Q208="300", Q211="0.25"),
        ["rapid 10 20 2", "line 10 20 -20 F150", "dwell 0.25", "line 10 20 2 F300", UP[1]],
    ),
    "201 comes out as it went in": (cycle(201, Q208="0"), ["rapid 10 20 2", "line 10 20 -20 F150", "line 10 20 2 F150", UP[1]]),
    "202 leaves the wall by 0.2": (
        cycle(202, Q208="250", Q214="1", Q211="0.5"),
        [
            "rapid 10 20 2",
            "line 10 20 -20 F150",
            "dwell 0.5",
            "orient",
            "rapid 9.8 20 -20",
            "line 9.8 20 2 F250",
            "rapid 9.8 20 50",
            "rapid 10 20 50",
            "spindle 500",
        ],
    ),
    "203 with smaller and smaller plunges": (
        cycle(203, Q202="10", Q212="3", Q205="4", Q208="99999"),
        [
            "rapid 10 20 2",
            "line 10 20 -10 F150",
            "rapid 10 20 2",
            "rapid 10 20 -8",
            "line 10 20 -17 F150",
            "rapid 10 20 2",
            "rapid 10 20 -15",
            "line 10 20 -20 F150",
            *UP,
        ],
    ),
    "203 breaks a chip before it comes out": (
        cycle(203, Q202="5", Q213="1", Q256="0.4", Q208="600"),
        [
            "rapid 10 20 2",
            "line 10 20 -5 F150",
            "line 10 20 -4.6 F3000",
            "line 10 20 -10 F150",
            "line 10 20 2 F600",
            "rapid 10 20 -8",
            "line 10 20 -15 F150",
            "line 10 20 -14.6 F3000",
            "line 10 20 -20 F150",
            "line 10 20 2 F600",
            UP[1],
        ],
    ),
    "204 from the far side": (
        cycle(204, Q249="+5", Q250="20", Q251="3.5", Q252="15", Q253="750", Q254="200", Q255="0.5", Q214="1"),
        [
            "rapid 10 20 2",
            "orient",
            "rapid -5 20 2",
            "line -5 20 -25.5 F750",
            "rapid 10 20 -25.5",
            "spindle 500",
            "line 10 20 -18.5 F200",
            "dwell 0.5",
            "line 10 20 -25.5 F750",
            "orient",
            "rapid -5 20 -25.5",
            "line -5 20 2 F750",
            "rapid -5 20 50",
            "rapid 10 20 50",
            "spindle 500",
        ],
    ),
    "205 with stop distances from Q258 to Q259": (
        cycle(205, Q201="-28", Q202="10", Q212="2", Q205="4", Q258="0.5", Q259="1", Q208="MAX"),
        [
            "rapid 10 20 2",
            "line 10 20 -10 F150",
            "rapid 10 20 2",
            "rapid 10 20 -9.5",
            "line 10 20 -18 F150",
            "rapid 10 20 2",
            "rapid 10 20 -17.25",
            "line 10 20 -24 F150",
            "rapid 10 20 2",
            "rapid 10 20 -23",
            "line 10 20 -28 F150",
            *UP,
        ],
    ),
    "205 from a deepened starting point, with chips": (
        cycle(205, Q202="20", Q257="8", Q256="0.2", Q379="5", Q253="750", Q208="MAX"),
        [
            "rapid 10 20 2",
            "line 10 20 -3 F750",
            "line 10 20 -13 F150",
            "line 10 20 -12.8 F3000",
            "line 10 20 -20 F150",
            *UP,
        ],
    ),
    "206 with a floating holder": (
        cycle(206, Q206="750", Q211="0.1"),
        [
            "rapid 10 20 2",
            "line 10 20 -20 F750 per 1.5",
            "dwell 0.1",
            "spindle -500",
            "line 10 20 2 F750 per 1.5",
            "spindle 500",
            UP[1],
        ],
    ),
    "207": (
        cycle(207, Q239="+1.5"),
        ["rapid 10 20 2", "line 10 20 -20 F750 per 1.5", "spindle -500", "line 10 20 2 F750 per 1.5", "spindle 0", UP[1]],
    ),
    "207 left-hand": (
        cycle(207, Q239="-1"),
        [
            "rapid 10 20 2",
            "spindle -500",
            "line 10 20 -20 F500 per 1",
            "spindle 500",
            "line 10 20 2 F500 per 1",
            "spindle 0",
            UP[1],
        ],
    ),
    "209 breaks chips by turns of the pitch": (
        cycle(209, Q239="+1", Q257="15", Q256="0.5", Q403="2"),
        [
            "rapid 10 20 2",
            "line 10 20 -15 F500 per 1",
            "spindle -1000",
            "line 10 20 -14.5 F1000 per 1",
            "spindle 500",
            "line 10 20 -20 F500 per 1",
            "spindle -1000",
            "line 10 20 2 F1000 per 1",
            "spindle 0",
            UP[1],
        ],
    ),
    "240": (cycle(240, Q343="0", Q201="-2", Q211="0.2"), ["rapid 10 20 2", "line 10 20 -2 F150", "dwell 0.2", *UP]),
    "241": (
        cycle(241, Q379="5", Q253="750", Q208="1000", Q426="5", Q427="50", Q428="400", Q211="0"),
        [
            "rapid 10 20 2",
            "spindle 0",
            "line 10 20 -5 F750",
            "spindle 400",
            "coolant on",
            "line 10 20 -20 F150",
            "coolant off",
            "spindle 50",
            "line 10 20 2 F1000",
            UP[1],
        ],
    ),
    "a depth of 0 is no cycle": (cycle(200, Q201="0", Q202="5"), []),
    "FAUTO is the feed of TOOL CALL": (
        ["TOOL CALL F80", *cycle(200, Q202="20", Q206="FAUTO")],
        ["rapid 10 20 2", "line 10 20 -20 F80", *UP],
    ),
}


@pytest.mark.parametrize(("blocks", "moves"), CASES.values(), ids=CASES.keys())
def test_a_cycle_makes_these_moves(blocks: list[str], moves: list[str]) -> None:
    assert moves_of(*BEFORE, *blocks) == [*MADE, *moves]


CALLS: dict[str, tuple[list[str], list[str]]] = {
    "M99 calls once": (["L X+1 FMAX M99", "L X+2 FMAX"], ["1"]),
    "M89 calls up to M99": (["L X+1 FMAX M89", "L X+2 FMAX", "L X+3 FMAX M99", "L X+4 FMAX"], ["1", "2", "3"]),
    "M89 ends at the next definition": (
        ["L X+1 FMAX M89", "CYCL DEF 200 Q200=2 Q201=-5 Q206=9 Q202=5 Q203=0 Q204=9", "L X+2 FMAX"],
        ["1"],
    ),
    "CYCL CALL POS": (["CYCL CALL POS X+7 Y+8 Z+1 FMAX"], ["7"]),
    "CYCL CALL PAT": (
        ["PATTERN DEF POS1 (X+3 Y+4 Z+0) ~", "  ROW1 (X+10 Y+0 D+5 NUM2 ROT+0 Z+0)", "CYCL CALL PAT FMAX"],
        ["3", "10", "15"],
    ),
    "a pattern on a circle": (["PATTERN DEF CIRC1 (X+0 Y+0 D20 START+0 NUM2 Z+0)", "CYCL CALL PAT"], ["10", "-10"]),
    "a pattern in rows": (
        ["PATTERN DEF PAT1 (X+0 Y+0 DX+5 DY+5 NUMX2 NUMY2 ROT+0 ROTX+0 ROTY+0 Z+0)", "CYCL CALL PAT"],
        ["0", "5", "5", "0"],
    ),
}


@pytest.mark.parametrize(("blocks", "places"), CALLS.values(), ids=CALLS.keys())
def test_a_cycle_runs_where_it_is_called(blocks: list[str], places: list[str]) -> None:
    definition = "CYCL DEF 200 DRILLING Q200=2 Q201=-5 Q206=150 Q202=5 Q203=+0 Q204=10"
    cuts = [move for move in moves_of(*BEFORE, definition, *blocks) if move.startswith("line")]
    assert [cut.split()[1] for cut in cuts] == places


def test_the_surface_of_cycl_call_pos_is_its_height() -> None:
    definition = "CYCL DEF 200 DRILLING Q200=2 Q201=-5 Q206=150 Q202=5 Q203=+0 Q204=10"
    found = moves_of(*BEFORE, definition, "CYCL CALL POS X+7 Y+8 Z-20 FMAX")
    assert found[len(MADE) :] == ["rapid 7 8 50", "rapid 7 8 -18", "line 7 8 -25 F150", "rapid 7 8 -18", "rapid 7 8 -10"]


def test_a_grid_runs_to_and_fro() -> None:
    definition = "CYCL DEF 200 DRILLING Q200=2 Q201=-5 Q206=150 Q202=5 Q203=+0 Q204=10"
    grid = "CYCL DEF 221 GRID Q225=+15 Q226=+15 Q237=+10 Q238=+8 Q242=3 Q243=2 Q224=+0 Q200=2 Q203=+0 Q204=50 Q301=0"
    found = moves_of(*BEFORE, definition, grid)[len(MADE) :]
    holes = [move.split()[1:3] for move in found if move.startswith("line")]
    assert holes == [["15", "15"], ["25", "15"], ["35", "15"], ["35", "23"], ["25", "23"], ["15", "23"]]
    # Between two places at the set-up clearance, at the end at the second one.
    assert found[:6] == [
        "rapid 15 15 50",
        "rapid 15 15 2",
        "line 15 15 -5 F150",
        "rapid 15 15 2",
        "rapid 25 15 2",
        "line 25 15 -5 F150",
    ]
    assert found[-1] == "rapid 15 23 50"


REFUSED = {
    "a depth out of the workpiece": (cycle(200, Q201="+5", Q202="5"), "Q201", "not negative"),
    "a parameter that is missing": (cycle(200), "CYCL DEF 200", "needs Q202"),
    "a plunge of nothing": (cycle(200, Q202="0"), "Q202", "more than 0"),
    "more plunges than any drill makes": (cycle(200, Q202="0.0001"), "CYCL DEF 200", "Settings.pecks_max"),
    "a depth to the full diameter": (cycle(200, Q202="5", Q395="1"), "Q395", "point angle"),
    "a call without a definition": (["CYCL CALL"], "CYCL CALL", "write CYCL DEF before"),
    "a cycle that is not read": (["CYCL DEF 256 STUD Q218=5"], "CYCL DEF 256", "is not read"),
    "a parameter that is none": (["CYCL DEF 200 DRILLING Q200=x"], "Q200=x", "is not a parameter"),
    "a cycle in rapid": (cycle(200, Q202="5", Q206="FMAX"), "Q206", "cannot be in rapid"),
}


@pytest.mark.parametrize(("blocks", "word", "reason"), REFUSED.values(), ids=REFUSED.keys())
def test_a_cycle_that_cannot_be_run_is_refused(blocks: list[str], word: str, reason: str) -> None:
    with pytest.raises(PartProgramError) as caught:
        interpret(program(*BEFORE, *blocks))
    assert caught.value.word == word
    assert reason in caught.value.reason


def test_a_fault_of_a_cycle_is_named_where_it_was_defined_and_by_the_number_of_its_block() -> None:
    text = program(
        "1 TOOL CALL 1 Z S1000",
        "2 L Z+50 R0 FMAX M3",
        "3 CYCL DEF 200 DRILLING ~",
        "    Q200=2 ~",
        "    Q201=-5 ~",
        "    Q206=150 ~",
        "    Q203=+0 ~",
        "    Q204=50",
        "4 L X+10 Y+10 R0 FMAX M99",
    )
    with pytest.raises(PartProgramError) as missing:
        interpret(text)
    assert str(missing.value) == "block 3 (line 4): CYCL DEF 200: needs Q202"
    with pytest.raises(PartProgramError) as wrong:
        interpret(text.replace("Q201=-5 ~", "Q201=+5 ~ \n    Q202=2 ~"))
    assert (wrong.value.line, wrong.value.block, wrong.value.word) == (6, 3, "Q201")


def test_a_fault_in_a_block_with_a_number_is_named_by_it() -> None:
    with pytest.raises(PartProgramError, match=r"^block 17 \(line 2\): M999"):
        interpret(program("17 L X+5 R0 FMAX M999"))
    with pytest.raises(PartProgramError, match=r"^line 2: M999"):
        interpret(program("L X+5 R0 FMAX M999"))
