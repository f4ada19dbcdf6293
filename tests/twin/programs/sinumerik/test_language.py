"""Numbers, expressions, variables, and the order of blocks: figures worked out by hand."""

import math

import pytest

from tests.twin.programs.sinumerik.reading import ends, run
from twin.errors import PartProgramError
from twin.programs import Linear, Rapid, Settings
from twin.programs.discovery import dialect_of


def value_of(expression: str, before: str = "") -> float:
    """The value of an expression, read off an axis."""
    return ends(run(f"{before}\nG0 X={expression}"))[-1][0]


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("1+2*3", 7.0),
        ("(1+2)*3", 9.0),
        ("-2+5", 3.0),
        ("7 DIV 2", 3.0),
        ("-7 DIV 2", -3.0),
        ("7 MOD 4", 3.0),
        ("7/2", 3.5),
        ("1.5EX3", 1500.0),
        ("25EX-1", 2.5),
        ("'H1F'", 31.0),
        ("'B101'", 5.0),
        ("SIN(30)", 0.5),
        ("COS(60)*10", 5.0),
        ("TAN(45)", 1.0),
        ("ASIN(0.5)", 30.0),
        ("ACOS(0.5)", 60.0),
        ("ATAN2(30.5,80.1)", 20.845785),  # The manual's own: ATAN2(30.5,80.1) is 20.8455°.
        ("SQRT(2)*SQRT(2)", 2.0),
        ("ABS(-3)", 3.0),
        ("POT(3)", 9.0),
        ("TRUNC(-2.7)", -2.0),
        ("ROUND(2.5)", 3.0),
        ("ROUND(-2.5)", -3.0),
        ("ROUNDUP(2.1)", 3.0),
        ("LN(EXP(2))", 2.0),
        ("MINVAL(3,5)", 3.0),
        ("MAXVAL(3,5)", 5.0),
        ("BOUND(1,10,12)", 10.0),
        ("6 B_AND 3", 2.0),
        ("6 B_OR 3", 7.0),
        ("6 B_XOR 3", 5.0),
        ("NOT 0", 1.0),
        ("(1==1) AND (2<>3)", 1.0),
        ("(1>2) OR (2<1)", 0.0),
        ("(1>2) XOR (2>1)", 1.0),
        ("TRUE+TRUE", 2.0),
        ("2*$PI", round(math.tau, 6)),
        ('STRLEN("ABC"<<12)', 5.0),
        ('NUMBER("2.5")', 2.5),
        ('SUBSTR("A12B",1,2)=="12"', 1.0),
    ],
)
def test_an_expression_has_the_value_that_the_manual_gives(expression: str, value: float) -> None:
    assert value_of(expression) == pytest.approx(value, abs=3e-4 if "ATAN2" in expression else 1e-6)


def test_r_parameters_are_set_read_and_computed_with_in_one_block_or_several() -> None:
    assert value_of("R1+R[2]", "R1=5 R2=R1*2\nR[R1-4]=7") == 17.0
    assert value_of("R10", "") == 0.0
    assert ends(run("G0 X=R7", Settings(parameters={"R7": 4.5}))) == [(4.5, 0.0, 0.0)]


def test_variables_keep_what_their_type_holds() -> None:
    defined = 'DEF INT COUNT=2.6\nDEF BOOL FLAG=5\nDEF REAL DEPTH\nDEF STRING[10] NAME="AB"\nDEF CHAR SIGN="A"'
    assert value_of("COUNT", defined) == 3.0
    assert value_of("FLAG", defined) == 1.0
    assert value_of("DEPTH", defined) == 0.0
    assert value_of("SIGN", defined) == 65.0
    assert value_of("STRLEN(NAME)", defined) == 2.0


def test_arrays_are_filled_by_set_and_rep_and_read_by_index() -> None:
    defined = "DEF REAL ROW[4]=SET(1,2,3)\nDEF INT GRID[2,3]\nGRID[1,2]=7\nDEF REAL ALL[3]=5\nROW[2]=SET(8,9)"
    assert [value_of(f"ROW[{at}]", defined) for at in range(4)] == [1.0, 2.0, 8.0, 9.0]
    assert value_of("GRID[1,2]*10+GRID[0,0]", defined) == 70.0
    assert value_of("ALL[0]+ALL[2]", defined) == 10.0
    assert value_of("ROW[3]", defined + "\nROW[1]=REP(6)") == 6.0


@pytest.mark.parametrize(
    ("text", "ends_x"),
    [
        ("FOR R1=1 TO 3\nG0 X=R1\nENDFOR", [1.0, 2.0, 3.0]),
        ("FOR R1=3 TO 1\nG0 X=R1\nENDFOR\nG0 X9", [9.0]),
        ("WHILE R1<2\nR1=R1+1\nG0 X=R1\nENDWHILE", [1.0, 2.0]),
        ("REPEAT\nR1=R1+1\nG0 X=R1\nUNTIL R1>=2", [1.0, 2.0]),
        ("LOOP\nR1=R1+1\nG0 X=R1\nIF R1==2 GOTOF OUT\nENDLOOP\nOUT: X9", [1.0, 2.0, 9.0]),
        ("IF R1==0\nG0 X1\nELSE\nG0 X2\nENDIF", [1.0]),
        ("R1=1\nIF R1==0\nG0 X1\nELSE\nIF R1==1\nG0 X5\nENDIF\nENDIF", [5.0]),
        ("IF R1 GOTOF SKIP\nG0 X1\nSKIP: G0 X2", [1.0, 2.0]),
        ("IF R1==1 GOTOF ONE IF R1==0 GOTOF NULL\nONE: G0 X1\nNULL: G0 X2", [2.0]),
        ("N10 R1=R1+1\nG0 X=R1\nIF R1<3 GOTOB N10", [1.0, 2.0, 3.0]),
        ("GOTO N30\nN20 G0 X1\nN30 G0 X2", [2.0]),
        ("GOTOC NOWHERE\nG0 X1", [1.0]),
        ('GOTOF "LAB"<<2\nLAB1: G0 X1\nLAB2: G0 X2', [2.0]),
        ("R1=2\nCASE R1 OF 1 GOTOF ONE 2 GOTOF TWO DEFAULT GOTOF REST\nONE: G0 X1\nTWO: G0 X2\nREST: G0 X3", [2.0, 3.0]),
        ("R1=7\nCASE R1 OF 1 GOTOF ONE DEFAULT GOTOF REST\nONE: G0 X1\nREST: G0 X3", [3.0]),
        ("AGAIN: G91 G0 X1\nREPEAT AGAIN P=2\nX10", [1.0, 2.0, 3.0, 13.0]),
        ("G91\nBEGIN: G0 X1\nX2\nLAST: X3\nX4\nREPEAT BEGIN LAST P=1\nX10", [1.0, 3.0, 6.0, 10.0, 11.0, 13.0, 16.0, 26.0]),
        ("G91\nONE: G0 X1\nX5\nREPEATB ONE P=2\nX10", [1.0, 6.0, 7.0, 8.0, 18.0]),
        ("/G0 X1\n/3 X2\nX3", [1.0, 2.0, 3.0]),
        ("DEF INT ONCE\nR1=R1+1\nG0 X=R1\nIF R1<2\nGOTOS\nENDIF", [1.0, 2.0]),
    ],
)
def test_blocks_are_run_in_the_order_of_the_control(text: str, ends_x: list[float]) -> None:
    assert [end[0] for end in ends(run(text))] == ends_x


def test_a_skip_level_that_is_on_leaves_its_blocks_out() -> None:
    assert [end[0] for end in ends(run("G0\n/ X1\n/3 X2\n/4 X3\nX4", Settings(block_skip=frozenset({0, 3}))))] == [3.0, 4.0]


SUBPROGRAMS = {
    "SUB1": (
        "PROC SUB1(REAL WAY, INT TIMES=2, VAR REAL TOTAL)\nDEF INT COUNT\nFOR COUNT=1 TO TIMES\nG91 X=WAY\nENDFOR\n"
        "TOTAL=WAY*TIMES\nG90\nM17"
    ),
    "L100.SPF": "G91 G0 X1\nG90\nRET",
    "KEEPS": "PROC KEEPS SAVE\nG91 G18\nTRANS X100\nM17",
    "DEEP": "DEEP\nM17",
    "OPEN": "G0 X7",
}


@pytest.mark.parametrize(
    ("text", "ends_x"),
    [
        ("DEF REAL SUM\nG0\nSUB1(3,,SUM)\nX=SUM", [3.0, 6.0, 6.0]),
        ("DEF REAL SUM\nG0\nSUB1(3,1,SUM)\nX=SUM*10", [3.0, 30.0]),
        ("L100 P3", [1.0, 2.0, 3.0]),
        ('CALL "L100"\nX9', [1.0, 9.0]),
        ("EXTERN SUB1(REAL,INT,VAR REAL)\nPCALL OPEN", [7.0]),
        ("KEEPS\nG0 X5", [5.0]),
        ("G0 X1\nMCALL L100\nX5\nY1\nMCALL\nX9", [1.0, 5.0, 6.0, 6.0, 7.0, 9.0]),
        ("%_N_INNER_SPF\nX2\nM17\n%_N_MAIN_MPF\nG0 X1\nINNER\nM30", [1.0, 2.0]),
        ("%_N_MAIN_MPF\nG0 X1\nINNER\nM30\n%_N_INNER_SPF\nX2\nM17", [1.0, 2.0]),
    ],
)
def test_subprograms_run_where_they_are_called(text: str, ends_x: list[float]) -> None:
    assert [end[0] for end in ends(run(text, Settings(programs=SUBPROGRAMS)))] == ends_x


def test_a_move_of_a_subprogram_names_it_and_counts_lines_in_it() -> None:
    moves = run("G0 X1\nOPEN", Settings(programs=SUBPROGRAMS))
    assert moves == [Rapid(0, (1.0, 0.0, 0.0)), Rapid(0, (7.0, 0.0, 0.0), "OPEN")]


def test_local_variables_end_with_their_program_and_r_parameters_do_not() -> None:
    programs = {"INNER": "DEF REAL OWN=5\nR1=OWN\nM17"}
    assert ends(run("INNER\nG0 X=R1", Settings(programs=programs))) == [(5.0, 0.0, 0.0)]
    with pytest.raises(PartProgramError, match="line 2: OWN: this variable is not known"):
        run("INNER\nG0 X=OWN", Settings(programs=programs))


@pytest.mark.parametrize(
    ("text", "settings", "reason"),
    [
        ("LOOP\nENDLOOP", Settings(jumps_max=100), "more than 100 jumps"),
        ("AGAIN: GOTOB AGAIN", Settings(jumps_max=100), "more than 100 jumps"),
        ("DEEP", Settings(programs=SUBPROGRAMS, call_depth_max=5), "nested deeper than 5"),
        ("G0 X1\nFOR R1=1 TO 1000\nX=R1\nENDFOR", Settings(blocks_max=50), "more than 50 blocks"),
        ("FOR R1=1 TO 1000\nG91 G0 X1\nENDFOR", Settings(moves_max=50), "more than 50 moves"),
        ("WHILE TRUE\nREPEAT\nUNTIL TRUE\nENDWHILE", Settings(jumps_max=100), "more than 100 jumps"),
        ("X=" + "(" * 40 + "1" + ")" * 40, Settings(), "nested deeper than 32"),
        ("X=" + "+".join(["1"] * 400), Settings(), "more than 256 operators"),
    ],
)
def test_what_has_no_end_is_an_error_by_the_bounds(text: str, settings: Settings, reason: str) -> None:
    with pytest.raises(PartProgramError, match=reason):
        run(text, settings)


def test_a_comment_may_hold_anything_and_a_text_a_semicolon() -> None:
    assert run('G1 X5 F100 ;X99 " ( [ §\nMSG("A;B") Y2 ; MCALL') == [
        Linear(0, (5.0, 0.0, 0.0), 100.0),
        Linear(1, (5.0, 2.0, 0.0), 100.0),
    ]


def test_small_letters_read_as_capitals() -> None:
    assert ends(run("def real depth=3\ng0 x=depth\nr1=2 y=r1")) == [(3.0, 0.0, 0.0), (3.0, 2.0, 0.0)]


@pytest.mark.parametrize(
    ("text", "language"),
    [
        ("%_N_PART_MPF\nG1 X5", "sinumerik"),
        ("G1 X=R1", "sinumerik"),
        ('T="MILL"', "sinumerik"),
        ("N10 MCALL CYCLE81(5,0,1,-5)", "sinumerik"),
        ("G2 X5 CR=10", "sinumerik"),
        ("O1 (SET X=100 F=5)\nG1 X5.", "fanuc"),
        ("(TOOL R1=5 SOFT)\nG1 X5. F100.", "fanuc"),
        ("; STOCK X=100 CR=5\nG21 G1 X5 F100", "fanuc"),
    ],
)
def test_a_text_is_known_by_its_words_and_not_by_its_comments(text: str, language: str) -> None:
    assert dialect_of(text).name == language
