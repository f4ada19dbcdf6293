"""Whatever the text: it is run or refused, in bounds; numbering, spaces and comments change nothing."""

from contextlib import suppress

from hypothesis import given, settings
from hypothesis import strategies as st

from twin.errors import PartProgramError
from twin.programs import Settings, ToolOffset
from twin.programs.klartext.interpreter import interpret
from twin.programs.klartext.source import blocks

BOUNDS = Settings(
    tool_offsets={1: ToolOffset(0.0, 2.0)}, jumps_max=50, blocks_max=500, moves_max=500, pecks_max=50, repeats_max=20
)
SIGNED = st.sampled_from(["+0", "-5", "+10", "-0,5", "+Q1", "-Q2", "+123.456", ""])
WORD = st.builds(
    "".join, st.tuples(st.sampled_from(["X", "Y", "Z", "IX", "IY", "PR", "PA", "IPA", "IZ", "R", "LEN", "CCA"]), SIGNED)
)
TAIL = st.sampled_from(
    ["", "F100", "FMAX", "RL F50", "RR", "R0", "DR+", "DR- F20", "M3", "M99", "M89", "M2", "M140 MB MAX", "F AUTO"]
)
HEAD = st.sampled_from(
    [
        "L",
        "C",
        "CR",
        "CT",
        "CC",
        "LP",
        "CP",
        "CTP",
        "RND",
        "CHF",
        "APPR LT",
        "APPR CT",
        "APPR LCT",
        "DEP LT",
        "DEP LCT",
        "CYCL CALL",
    ]
)
PATH = st.builds(" ".join, st.tuples(HEAD, WORD, WORD, TAIL))
OTHER = st.sampled_from(
    [
        "TOOL CALL 1 Z S100 F50",
        "LBL 1",
        "LBL 0",
        "CALL LBL 1",
        "CALL LBL 1 REP 2",
        "FN 12: IF +Q1 LT +5 GOTO LBL 1",
        "Q1 = Q1 + 1",
        "FN 0: Q2 = +3",
        "CYCL DEF 7.1 X+5",
        "CYCL DEF 8.1 X",
        "CYCL DEF 10.1 ROT+30",
        "CYCL DEF 200 D Q200=2 Q201=-5 Q206=9 Q202=2 Q203=+0 Q204=9",
        "CYCL DEF 252 P Q223=20 Q207=9 Q201=-5 Q206=9 Q202=5 Q200=2 Q203=+0 Q204=9 Q366=0",
        "CYCL DEF 11.1 SCL 2",
        "STOP",
        "END PGM A MM",
    ]
)
PROGRAMS = st.lists(PATH | OTHER, min_size=1, max_size=12)


@settings(max_examples=100, deadline=None)
@given(PROGRAMS)
def test_blocks_in_any_order_are_run_or_refused(given_blocks: list[str]) -> None:
    text = "\n".join(["BEGIN PGM A MM", "TOOL CALL 1 Z S100 F50", "Q1 = 1", "FN 0: Q2 = +2", *given_blocks])
    try:
        moves = interpret(text, BOUNDS)
    except PartProgramError as refused:
        assert 1 <= refused.line <= len(given_blocks) + 4
        assert refused.reason
    else:
        assert all(0 <= move.line < len(given_blocks) + 4 for move in moves)
        assert len(moves) <= BOUNDS.moves_max + 1


@settings(max_examples=50, deadline=None)
@given(PROGRAMS)
def test_numbers_spaces_and_comments_change_nothing(given_blocks: list[str]) -> None:
    plain = ["BEGIN PGM A MM", "TOOL CALL 1 Z S100 F50", "Q1 = 1", "FN 0: Q2 = +2", *given_blocks]
    dressed = [f"  {number} {block}   ; F1 M30 L X+1" for number, block in enumerate(plain)]

    def outcome(lines: list[str]) -> object:
        try:
            return interpret("\r\n".join(lines), BOUNDS)
        except PartProgramError as refused:
            return (refused.line, refused.word, refused.reason)

    assert outcome(dressed) == outcome(plain)


@settings(max_examples=60)
@given(st.text(alphabet='LXYZCPRQFMN0123456789+-=.,;~"*/()%:# \n\t', max_size=80))
def test_any_characters_are_split_into_blocks_in_order(text: str) -> None:
    found = blocks(text)
    assert all(len(source.body) == len(source.written) for source in found)
    assert [source.line for source in found] == sorted({source.line for source in found})
    with suppress(PartProgramError):
        interpret(text, BOUNDS)


PLAIN_WORDS = st.tuples(
    st.sampled_from(["", " X+5", " X-0,25", " X3."]),
    st.sampled_from(["", " Y+1", " Y-.5"]),
    st.sampled_from(["", " Z-2"]),
    st.sampled_from(["", " R0"]),
    st.sampled_from(["", " F100", " FMAX", " F12.5", " F MAX"]),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.builds("".join, PLAIN_WORDS), min_size=1, max_size=6), st.sampled_from(["MM", "INCH"]))
def test_the_short_way_is_the_long_way(words: list[str], unit: str) -> None:
    """M107 changes nothing, and has no short way."""
    short = "\n".join([f"BEGIN PGM A {unit}", "L X+1 F50", *(f"L{one}" for one in words)])
    long = "\n".join([f"BEGIN PGM A {unit}", "L X+1 F50 M107", *(f"L{one} M107" for one in words)])
    assert interpret(short, BOUNDS) == interpret(long, BOUNDS)
