"""Whatever the text is, the answer is moves or a PartProgramError that names a line of it."""

import math
from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.depth import examples
from twin.errors import PartProgramError
from twin.programs import Arc, IntegerWords, Linear, Rapid, Settings, ToolOffset
from twin.programs.fanuc.interpreter import interpret

BOUNDED = Settings(
    axes=("x", "y", "z", "a"),
    tool_offsets={1: ToolOffset(50.0, 5.0), 2: ToolOffset(10.0, 1.0)},
    subprograms={7: "G1X1\nM99", 8: "#1=#1+1\nG0X#1\nM99P10"},
    optional_stop=True,
    jumps_max=300,
    blocks_max=2000,
    moves_max=20_000,
    repeats_max=50,
    pecks_max=100,
)
SOUP = st.sampled_from(
    [
        *(f"G{code}" for code in range(100)),
        *("G54.1", "G92.1", "G5.1", "P1", "P2", "P7", "P100", "Q1", "Q2.", "R1", "R-5", "R2.", "X1", "X-3.5", "Y2", "Z-4", "X0"),
        *("Y10", "I1", "J-2", "K3", "I0", "F100", "F0.1", "S1000", "M3", "M5", "M6", "T1", "H1", "D1", "L2", "L10", "K0", "M98"),
        *(
            "M99",
            "M30",
            "M0",
            "M29",
            "N10",
            "O7",
            "#1",
            "#100",
            "#5021",
            "#2001",
            "#4001",
            "#0",
            "=",
            "+",
            "-",
            "*",
            "/",
            "[",
            "]",
        ),
        *("SIN", "COS", "ATAN", "SQRT", "MOD", "ROUND", "BIN", "BCD", "LN", "EXP", "EQ", "NE", "GT", "AND", "OR", "XOR", "IF"),
        *("THEN", "GOTO", "GOTO10", "WHILE", "DO1", "END1", "DO2", "END2", "(a)", "(", "%", ";", ",R1", ",C2", "/2", "1", "2.5"),
        *("99999", "A90", "B1", "U2", "\n", " ", "é", "\u2028", "\x00", "\r"),
    ]
)
SENSE = st.sampled_from(
    [
        *("G90", "G91", "G20", "G21", "G17", "G18", "G19", "G0X1Y2", "G1X5F100", "X10", "Y10", "Z-5", "X0Y0", "G1X3,R2", "Y3,C1"),
        *("G2X10Y10R20", "G3I5", "G3X3Y3I2J1", "G41D1", "G42D2", "G40", "G68X1Y1R30", "G69", "G51X0Y0P2000", "G51I2.J-2.K1."),
        *("G50", "G16", "G15", "G81X5Y5Z-5R2F50", "G83X1Z-9Q2R1", "G76X3Z-4R1Q.5", "G87X3Z4R-10Q1", "G84X2Z-3R1F100", "S500M3"),
        *(
            "G80",
            "G98",
            "G99",
            "G55",
            "G54.1P3",
            "G52X5",
            "G92X1Y1",
            "G10L2P1X5",
            "G10L12P1R3",
            "G43H1",
            "G49",
            "G28X0",
            "G30P2Z0",
        ),
        *(
            "G53X1",
            "G31X5",
            "G4P10",
            "G95F.1",
            "G94F100",
            "G93F2",
            "G96S100",
            "G97S1000",
            "G9X3",
            "G61",
            "G64",
            "G5.1Q1",
            "M98P7",
        ),
        *("G65P7A1", "G66P7", "G67", "#1=#1+1", "#2=#5001*2", "X#1", "Y[#2+1]", "IF[#1LT5]GOTO10", "N10", "WHILE[#1LT3]DO1"),
        *("END1", "GOTO10", "M98P00030007", "G33Z-5F2", "M29S100"),
    ]
)


def survives(text: str, chosen: Settings) -> None:
    try:
        moves = interpret(text, chosen)
    except PartProgramError as refused:
        assert refused.line >= 1
        assert refused.reason
        return
    for move in moves:
        if isinstance(move, Rapid | Linear | Arc):
            assert len(move.end_mm) == 4
            assert all(map(math.isfinite, move.end_mm))
        if isinstance(move, Arc):
            assert math.isfinite(move.sweep_rad)
        if isinstance(move, Linear | Arc):
            assert 0.0 < move.feed_mm_min < math.inf


@settings(max_examples=examples(500, 150))
@given(st.lists(SOUP, max_size=40).map("".join), st.sampled_from(IntegerWords))
def test_a_soup_of_tokens_is_moves_or_an_error(text: str, integers: IntegerWords) -> None:
    survives(text, replace(BOUNDED, integer_words=integers))


@settings(max_examples=examples(500, 150))
@given(st.lists(SENSE, max_size=30).map("\n".join))
def test_blocks_that_make_sense_in_an_order_that_does_not_are_moves_or_an_error(text: str) -> None:
    survives(text, BOUNDED)


@settings(max_examples=examples(200, 100))
@given(st.text(max_size=80))
def test_any_characters_are_moves_or_an_error(text: str) -> None:
    survives(text, BOUNDED)


@given(st.lists(SENSE, max_size=20))
def test_a_program_runs_the_same_twice_and_with_any_line_ends(blocks: list[str]) -> None:
    def outcome(text: str) -> object:
        try:
            return interpret(text, BOUNDED)
        except PartProgramError as refused:
            return str(refused)

    first = outcome("\n".join(blocks))
    assert outcome("\n".join(blocks)) == first
    assert outcome("\r\n".join(blocks)) == first
    assert outcome("\n".join(blocks).lower()).__class__ is first.__class__


@given(st.lists(st.tuples(*[st.decimals(-999, 999, places=3)] * 3), min_size=1, max_size=10), st.booleans())
def test_the_short_way_and_the_long_way_of_a_plain_block_agree(points: list[tuple[object, ...]], absolute: bool) -> None:
    head = f"G{90 if absolute else 91} G1 F500.\n"
    plain = head + "\n".join(f"X{x} Y{y} Z{z}" for x, y, z in points)
    # A comment, or another order of words, is not taken by the pattern of plain blocks.
    long = head + "\n".join(f"Z{z} X{x} Y{y} (LONG)" for x, y, z in points)
    assert interpret(plain) == interpret(long)


@given(st.lists(st.tuples(st.sampled_from((2, 3)), st.integers(1, 500), st.integers(-500, 500)), min_size=1, max_size=10))
def test_the_short_way_and_the_long_way_of_a_plain_arc_agree(arcs: list[tuple[int, int, int]]) -> None:
    plain = "G91 G1 F500.\n" + "\n".join(f"G{code} X{2 * i}. Y{2 * j}. Z-1. I{i}. J{j}." for code, i, j in arcs)
    long = plain.replace("\n", " (LONG)\n") + " (LONG)"
    assert interpret(plain) == interpret(long)
