"""Whatever the text is, the answer is moves or a PartProgramError that names a line of it."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.depth import examples
from twin.errors import PartProgramError
from twin.programs import Arc, Linear, Rapid, Settings, ToolOffset
from twin.programs.sinumerik.interpreter import interpret

BOUNDED = Settings(
    axes=("x", "y", "z", "a"),
    tool_offsets={1: ToolOffset(50.0, 5.0), 2: ToolOffset(10.0, 1.0)},
    programs={"SUB1": "PROC SUB1(REAL AA, VAR REAL BB)\nBB=AA+1\nG1X=AA\nM17", "SUB2": "R1=R1+1\nG0 X=R1\nSUB2\nRET"},
    optional_stop=True,
    jumps_max=300,
    blocks_max=2000,
    moves_max=20_000,
    repeats_max=50,
    pecks_max=100,
)
SOUP = st.sampled_from(
    [
        *("G0", "G1", "G2", "G3", "CIP", "CT", "G4", "G9", "G17", "G18", "G19", "G25", "G26", "G33", "G331", "G332", "G40"),
        *("G41", "G42", "G53", "SUPA", "G54", "G505", "G500", "G60", "G63", "G64", "G641", "G642", "G70", "G71", "G700"),
        *("G74", "G90", "G91", "G93", "G94", "G95", "G96", "G97", "G110", "G111", "G112", "G153", "G290", "G291", "G450"),
        *("G451", "CFC", "CFTCP", "CFIN", "NORM", "KONT", "TRANS", "ATRANS", "ROT", "AROT", "SCALE", "ASCALE", "MIRROR"),
        *("AMIRROR", "SOFT", "BRISK", "FFWON", "COMPCAD", "M0", "M1", "M3", "M4", "M5", "M6", "M8", "M9", "M17", "M19"),
        *("M30", "T1", "T2", "D0", "D1", "S500", "F100", "F0.1", "X1", "X-3.5", "Y2", "Z-4", "X0", "Y10", "A90", "X=AC(3)"),
        *("Y=IC(2)", "A=DC(5)", "I1", "J-2", "K3", "I=AC(2)", "I1=3", "J1=4", "CR=5", "CR=-3", "AR=90", "AP=45", "RP=3"),
        *("TURN=1", "RND=1", "CHF=1", "CHR=2", "RNDM=1", "RNDM=0", "FRC=5", "ANG=30", "RPL=20", "LIMS=100", "CTOL=0.1"),
        *("ADIS=0.5", "OFFN=1", "DISC=0", "SPOS=0", "R1", "R2=3", "R[1]=2", "R1=R1+1", "DEF", "REAL", "INT", "AA", "BB"),
        *("AA[2]", "MCALL", "SUB1", "SUB2", "L10", "P2", "IF", "ELSE", "ENDIF", "WHILE", "ENDWHILE", "FOR", "TO", "ENDFOR"),
        *("LOOP", "ENDLOOP", "REPEAT", "UNTIL", "GOTOF", "GOTOB", "GOTO", "LAB", "LAB:", "CASE", "OF", "DEFAULT", "PROC"),
        *("RET", "CALL", "CYCLE81(5,0,1,-5)", "CYCLE83(5,0,1,-9,,,2,0,0,0,1,1)", "CYCLE84(5,0,1,-5,,,3,8)"),
        *("POCKET3(5,0,1,-3,30,20,6,0,0,0,2,0,0,50,40,0,11)", "POCKET4(5,0,1,-3,20,0,0,2,0,0,50,40,0,21,0,0,0,2,1)"),
        *("SLOT1(5,0,1,-3,,2,30,10,0,0,9,0,90,50,40,1,0,0,0)", "HOLES2(0,0,9,0,,3)"),
        *("LONGHOLE(5,0,1,-3,,2,30,0,0,9,0,90,50,40,1)", "CYCLE71(5,0,1,-2,0,0,30,20,0,1,3,0,0,50,31,0)", "CYCLE832(0.1,1)"),
        *("CYCLE76(5,0,1,-3,,30,20,4,0,0,0,2,0,0,50,40,0,1,36)", "CYCLE77(5,0,1,-3,,30,0,0,2,0,0,50,40,1,1,36)"),
        *('MSG("A")', "STOPRE", "(", ")", "[", "]", ",", "=", "==", "<>", "<", ">", "+", "-", "*", "/", "<<", "DIV", "MOD"),
        *("AND", "OR", "NOT", "SIN(", "SQRT(", "ABS(", "1", "2.5", "99999", "'HF'", '"A"', ";", ":", "§", "é", "\x00"),
        *(
            "$P_EP[X]",
            "$AA_IM[Z]",
            "N10",
            "/2",
            "/",
        ),
        *("\n", "\n", " "),
    ]
)
SENSE = st.sampled_from(
    [
        *(
            "G90",
            "G91",
            "G17",
            "G18",
            "G19",
            "G0 X1 Y2",
            "G1 X5 F100",
            "X10",
            "Y10",
            "Z-5",
            "X0 Y0",
            "G1 X3 RND=1",
            "Y3 CHF=1",
            "G70",
        ),
        *(
            "G2 X10 Y10 CR=20",
            "G3 I5",
            "G3 X3 Y3 I2 J1",
            "T1 M6",
            "T2 M6",
            "G41",
            "G42 X5",
            "G40",
            "G40 X-9 Y-9",
            "ROT RPL=30",
            "TRANS X1",
        ),
        *(
            "AROT X10",
            "SCALE X2 Y2",
            "MIRROR X0",
            "TRANS",
            "G111 X1 Y1",
            "AP=30 RP=4",
            "CIP X5 Y5 I1=2 J1=4",
            "CT X9 Y1",
            "ANG=30",
            "G450",
        ),
        *(
            "X20 Y0 ANG=-45",
            "G451",
            "S500 M3",
            "G95 F0.1",
            "G94 F100",
            "G93 F2",
            "G96 S100 LIMS=900",
            "G97 S100",
            "G9 X3",
            "G60",
            "G64",
        ),
        *(
            "MCALL CYCLE81(5,0,1,-5)",
            "MCALL SUB2",
            "MCALL",
            "HOLES1(0,0,0,1,2,3)",
            "CYCLE801(0,0,0,1,1,2,2)",
            "CYCLE82(5,0,1,-5,,1)",
        ),
        *(
            "CYCLE83(5,0,1,-9,,,3,1,0,0,1,0)",
            "CYCLE84(5,0,1,-5,,,3,8,,0,99)",
            "CYCLE840(5,0,1,-5,,0,0,3,0,8)",
            "CYCLE86(5,0,1,-5,,1,3,1,1,1)",
        ),
        *(
            "POCKET3(5,0,1,-3,30,20,6,0,0,0,2,1,1,50,40,0,12)",
            "POCKET4(5,0,1,-3,20,0,0,2,0,0,50,40,0,21,0,0,0,2,1)",
            "SUPA G0 Z5",
            "G505",
        ),
        *(
            "SLOT2(5,0,1,-3,,2,40,9,0,0,20,0,90,50,40,1,2,0.3,0)",
            "R1=R1+1",
            "IF R1<3 GOTOB LAB",
            "LAB:",
            "REPEAT LAB P=2",
            "SUB1(2,R1)",
        ),
        *(
            "FOR R2=1 TO 2",
            "ENDFOR",
            "WHILE R1<3",
            "ENDWHILE",
            "IF R1==1",
            "ELSE",
            "ENDIF",
            "X=R1",
            "G4 F1",
            "M0",
            "D0",
            "D1",
            "OFFN=1",
        ),
        *(
            "RNDM=1",
            "RNDM=0",
            "$P_UIFR[1,X,TR]=5",
            "G54",
            "X=$P_EP[X]+1",
            "CYCLE832(0.1,1,1)",
            "G331 Z-5 K1",
            "G332 Z5 K1",
            "G33 Z-1 K1",
        ),
    ]
)


def survives(text: str) -> None:
    try:
        moves = interpret(text, BOUNDED)
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


@settings(max_examples=examples(600, 200), deadline=None)
@given(st.lists(SOUP, max_size=40).map(" ".join))
def test_a_soup_of_words_is_moves_or_an_error(text: str) -> None:
    survives(text)


@settings(max_examples=examples(600, 200), deadline=None)
@given(st.lists(SENSE, max_size=30).map("\n".join))
def test_blocks_that_make_sense_in_an_order_that_does_not_are_moves_or_an_error(text: str) -> None:
    survives("F100 S500 M3\n" + text)


@settings(max_examples=examples(300, 100), deadline=None)
@given(st.text(max_size=80))
def test_any_characters_are_moves_or_an_error(text: str) -> None:
    survives(text)


@settings(deadline=None)
@given(st.lists(SENSE, max_size=20))
def test_a_program_runs_the_same_twice_and_with_any_line_ends(blocks: list[str]) -> None:
    def outcome(text: str) -> object:
        try:
            return interpret(text, BOUNDED)
        except PartProgramError as refused:
            return str(refused)

    first = outcome("\n".join(blocks))
    assert outcome("\r\n".join(blocks)) == first
    assert outcome("\r".join(blocks)) == first
