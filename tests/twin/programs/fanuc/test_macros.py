"""Macro B and the order of blocks: arithmetic, null, jumps, loops, calls, system variables."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.errors import PartProgramError
from twin.programs import IntegerWords, Linear, Move, Rapid, Settings, ToolOffset
from twin.programs.fanuc.interpreter import interpret


def value(expression: str, before: str = "", settings: Settings | None = None) -> float:
    """Return what an expression comes to, by way of a position."""
    (move,) = interpret(f"{before}\nG0 X[{expression}]", settings)
    assert isinstance(move, Rapid)
    return move.end_mm[0]


def xs(moves: list[Move]) -> list[float]:
    return [round(move.end_mm[0], 6) for move in moves if isinstance(move, Rapid | Linear)]


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("1+2*3", 7.0),
        ("[1+2]*3", 9.0),
        ("10-4-3", 3.0),
        ("100/5/2", 10.0),
        ("17MOD5", 2.0),
        ("-17MOD5", -2.0),
        ("--3", 3.0),
        ("12AND10", 8.0),
        ("12OR10", 14.0),
        ("12XOR10", 6.0),
        ("1+12AND10", 9.0),
        ("SIN[30]", 0.5),
        ("COS[60]", 0.5),
        ("TAN[45]", 1.0),
        ("ASIN[-.5]", 330.0),
        ("ACOS[-.5]", 120.0),
        ("ATAN[1]", 45.0),
        ("ATAN[-1]/[-1]", 225.0),
        ("ATAN[-1]/2", -22.5),
        ("SQRT[2]*SQRT[2]", 2.0),
        ("ABS[-3.5]", 3.5),
        ("ROUND[2.5]+ROUND[-2.5]+ROUND[2.4]", 2.0),
        ("FIX[2.9]+FIX[-2.9]", 0.0),
        ("FUP[2.1]+FUP[-2.1]", 0.0),
        ("LN[EXP[3]]", 3.0),
        ("BIN[37]", 25.0),
        ("BCD[25]", 37.0),
        ("2GT1", 1.0),
        ("[1EQ1]AND[2NE2]", 0.0),
        ("#0+5", 5.0),
    ],
)
def test_arithmetic_is_that_of_the_control(expression: str, expected: float) -> None:
    assert value(expression) == pytest.approx(expected, abs=1e-12)


def test_angles_are_signed_where_the_control_is_set_so() -> None:
    signed = Settings(angle_signed=True)
    assert value("ATAN[-1]/[-1]", settings=signed) == pytest.approx(-135.0)
    assert value("ASIN[-.5]", settings=signed) == pytest.approx(-30.0)


@given(st.lists(st.tuples(st.sampled_from("+-*"), st.integers(-50, 50)), min_size=1, max_size=6))
def test_a_chain_of_operators_is_what_python_says(chain: list[tuple[str, int]]) -> None:
    ours, theirs = "1", 1.0
    terms = [[1.0]]
    signs = [1.0]
    for operator, number in chain:
        ours += f"{operator}[{number}]"
        if operator == "*":
            terms[-1].append(float(number))
        else:
            terms.append([float(number)])
            signs.append(1.0 if operator == "+" else -1.0)
    theirs = sum(sign * math.prod(factors) for sign, factors in zip(signs, terms, strict=True))
    if abs(theirs) < 1e8:
        assert value(ours) == pytest.approx(theirs)


@pytest.mark.parametrize(
    ("condition", "holds"),
    [
        ("#1EQ#0", True),
        ("#1NE#0", False),
        ("#1EQ0", False),
        ("#1NE0", True),
        ("#1GE0", True),
        ("#1LT0", False),
        ("#2EQ#0", False),
    ],
)
def test_null_is_not_zero_where_equality_is_asked(condition: str, holds: bool) -> None:
    assert xs(interpret(f"#2=0\nIF[{condition}]THEN#3=7\nG0X[#3+0]")) == [7.0 if holds else 0.0]


def test_a_word_whose_variable_is_null_is_not_there() -> None:
    assert interpret("G0 X1 Y2\nG0 X#1 Y5\nX#0") == [Rapid(0, (1.0, 2.0, 0.0)), Rapid(1, (1.0, 5.0, 0.0))]
    assert value("#5", "#4=1\n#5=#4\n#4=#0") == 1.0
    with pytest.raises(PartProgramError, match="#0"):
        interpret("#0=1")


def test_round_in_a_word_rounds_to_its_increment() -> None:
    assert xs(interpret("#1=1.23456\nG0 X[#1]\nX ROUND[#1]\nX-ROUND[#1]\nX[ROUND[#1]]")) == [1.23456, 1.235, -1.235, 1.0]


def test_variables_may_be_chosen_by_variables() -> None:
    assert value("#[#1+1]", "#1=100\n#101=6") == 6.0
    assert value("##1", "#1=101\n#101=6") == 6.0
    assert value("#500", settings=Settings(variables={500: 3.25})) == 3.25


def test_loops_nest_three_deep_and_jumps_go_forward_first() -> None:
    text = """#100=0
    #1=0
    WHILE[#1LT2]DO1
    #2=0
    WHILE[#2LT3]DO2
    #3=0
    N5WHILE[#3LT4]DO3
    #100=#100+1
    #3=#3+1
    N7END3
    #2=#2+1
    END2
    #1=#1+1
    END1
    GOTO10
    N20G0X1
    N10G0X#100
    N20G0X3
    #110=#110+1
    IF[#110LT2]GOTO20
    M30"""
    # Forward from the IF there is no N20, so the search goes on from the top and finds the first.
    assert xs(interpret(text)) == [24.0, 3.0, 1.0, 24.0, 3.0]


def test_a_loop_whose_condition_fails_at_once_is_skipped() -> None:
    assert xs(interpret("WHILE[1EQ2]DO1\nG0X1 (END1)\nEND1\nG0X2")) == [2.0]
    assert xs(interpret("DO1\n#1=#1+1\nIF[#1EQ5]GOTO9\nEND1\nN9G0X#1")) == [5.0]


def test_subprograms_share_variables_and_macros_have_their_own() -> None:
    main = "#1=5\nM98 P10\nG65 P20 A7. X3. I1. J2. I4.\nG0 X#1\nM30\n"
    text = main + "O10\n#1=#1+1\nM99\nO20\nG0 X[#1+#24] Y[#4+#5*10+#7*100]\n#1=99\nM99"
    assert interpret(text)[:2] == [Rapid(9, (10.0, 421.0, 0.0)), Rapid(3, (6.0, 421.0, 0.0))]


@pytest.mark.parametrize("call", ["M98 P10 L3", "M98 P30010", "M98 P00030010", "G65 P10 L3 A1."])
def test_a_call_is_repeated(call: str) -> None:
    assert xs(interpret(f"{call}\nM30\nO10\n#100=#100+1\nG0X#100\nM99")) == [1.0, 2.0, 3.0]


def test_a_return_may_go_to_a_sequence_number() -> None:
    assert xs(interpret("M98 P10\nG0X1\nN50G0X2\nM30\nO10\nM99 P50")) == [2.0]
    assert xs(interpret("N1 #1=#1+1\nG0X#1\nIF[#1EQ3]GOTO9\nM99\nN9M30")) == [1.0, 2.0, 3.0]


def test_arguments_without_a_point_count_increments_where_the_control_is_set_so() -> None:
    text = "G65 P1 X1500 I2. H3\nM30\nO1\nG0 X#24 Y#4 Z#11\nM99"
    assert interpret(text, Settings(integer_words=IntegerWords.INCREMENTS))[0] == Rapid(3, (1.5, 2.0, 3.0))


def test_a_modal_call_follows_each_move_until_it_is_cancelled() -> None:
    text = "G66 P10 Z-5. R2.\nG0 X1\nM8\nX2\nG67\nX3\nM30\nO10\nG0 Z#18\nG1 Z#26 F100.\nG0 Z10.\nM99"
    lines = [move.line for move in interpret(text) if isinstance(move, Rapid | Linear)]
    assert lines == [1, 8, 9, 10, 3, 8, 9, 10, 5]


def test_a_subprogram_of_its_own_text_names_itself() -> None:
    settings = Settings(subprograms={1000: "(HEAD)\nG0 X1\nM99"})
    assert interpret("M98 P1000", settings) == [Rapid(1, (1.0, 0.0, 0.0), "O1000")]
    with pytest.raises(PartProgramError) as caught:
        interpret("M98 P1001", Settings(subprograms={1001: "G0 X1\nG0 Q[\nM99"}))
    assert (caught.value.line, caught.value.program) == (2, "O1001")


@pytest.mark.parametrize(
    ("before", "expression", "expected"),
    [
        ("G55 G0 Y1", "#4014", 55.0),
        ("G91 G1 Y1 F30.", "#4001+#4003+#4109", 122.0),
        ("G20 F10.", "#4006+#4109", 30.0 * 25.4),
        ("T12 S300", "#4120+#4119", 312.0),
        ("G54 G10 L2 P1 Y7", "#5222", 7.0),
        ("#5222=3\n#2602=4\nG55", "#2601+#5242", 0.0 + 4.0 + 3.0 - 3.0 - 0.0 + 3.0),
        ("#7002=4", "#7002", 4.0),
        ("#13003=2.5", "#13003+#11003", 2.5 + 20.0),
        ("G43 H3 G0 Z5", "#5023-#5003", 20.0),
        ("#3901=4\n#3001=9", "#3901+#3001", 13.0),
    ],
)
def test_system_variables_show_the_control(before: str, expression: str, expected: float) -> None:
    settings = Settings(tool_offsets={3: ToolOffset(length_mm=20.0)})
    assert xs(interpret(f"{before}\n#33={expression}\nG90 G54 G0 X#33", settings))[-1] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("text", "line", "word", "reason"),
    [
        ("G0 X[1/0]", 1, "/", "zero"),
        ("#1=SQRT[-1]", 1, "SQRT", "no value at -1"),
        ("#1=EXP[9999]", 1, "EXP", "too large"),
        ("#1=1.5AND1", 1, "AND", "integer"),
        ("#1=BIN[26]", 1, "BIN", "BCD"),
        ("#50=1", 1, "#50", "cannot be set"),
        ("#1=#3011", 1, "#3011", "[control] variables"),
        ("#3000=12 (TOOL BROKEN)", 1, "#3000", "alarm 12"),
        ("#1=[1+", 1, "+", "ends inside"),
        ("#1=[1 2]", 1, "2", "']'"),
        ("#1=1 #2=2", 1, "#", "block of its own"),
        ("IF[1EQ1]", 1, "IF", "GOTO or THEN"),
        ("\nGOTO7", 2, "N7", "no such sequence"),
        ("GOTO#1", 1, "GOTO", "null"),
        ("WHILE[1EQ1]DO1\nG0X1", 1, "", "DO and END"),
        ("END1", 1, "", "DO and END"),
        ("WHILE[1EQ1]DO4", 1, "WHILE", "1, 2 or 3"),
        ("M98 P7", 1, "P7", "no program O0007"),
        ("M98 P7\nM30\nO7\nG0X1", 4, "", "without M99"),
        ("G0X1\nO7\nM99", 2, "", "next O number"),
        ("G65 A1.", 1, "G65", "write P"),
        ("G65 P7 A1. A2.\nM30\nO7\nM99", 1, "A2.", "twice"),
        ("N1GOTO1", 1, "", "no end"),
        ("WHILE[1EQ1]DO1\nEND1", 2, "", "no end"),
        ("G0X1\nM99", 2, "", "no end"),
        ("M98P7\nM30\nO7\nM98P7\nM99", 4, "P7", "deeper"),
        ("X" + "[" * 40 + "1" + "]" * 40, 1, "[", "deeper"),
        ("#<name>=1", 1, "#<name>=1", "no meaning"),
    ],
)
def test_a_wrong_macro_is_named(text: str, line: int, word: str, reason: str) -> None:
    with pytest.raises(PartProgramError) as caught:
        interpret(text, Settings(jumps_max=1000))
    assert (caught.value.line, caught.value.word) == (line, word)
    assert reason in caught.value.reason


def test_a_thousand_terms_in_a_row_are_no_depth() -> None:
    assert value("+".join(["1"] * 3000)) == 3000.0
