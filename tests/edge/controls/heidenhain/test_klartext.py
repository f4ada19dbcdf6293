"""Klartext programs: blocks by their numbers, and what in them concerns tools and the way through the program."""

from hypothesis import given
from hypothesis import strategies as st

from edge.controls.heidenhain.klartext import Kind, read_program


def program_of(*blocks: str) -> str:
    """These blocks, numbered, between BEGIN and END."""
    lines = ["BEGIN PGM P MM", *blocks, "END PGM P MM"]
    return "".join(f"{number} {line}\n" for number, line in enumerate(lines))


def test_lines_without_a_number_go_on_with_the_block_before() -> None:
    program = read_program(program_of("CYCL DEF 200 DRILLING ~\n    Q200=2 ;SET-UP ~\n    Q201=-4 ;DEPTH", "L X+1"))
    assert program.block(1) == "CYCL DEF 200 DRILLING Q200=2 ;SET-UP Q201=-4 ;DEPTH"
    assert program.block(2) == "L X+1"
    assert (program.block(4), program.block(-1)) == (None, None)


def test_a_text_without_any_numbers_is_counted_as_the_control_counts() -> None:
    program = read_program("BEGIN PGM P MM\nTOOL CALL 5 Z S100\nL X+1\nEND PGM P MM\n")
    assert (program.fault, program.block(1), program.steps[0].number) == ("", "TOOL CALL 5 Z S100", 1)


def test_a_text_that_is_not_whole_is_nothing() -> None:
    whole = program_of("TOOL CALL 5 Z S100", "L X+1", "L X+2")
    for text in (whole.replace("2 L X+1\n", ""), whole.removesuffix("4 END PGM P MM\n"), whole[20:], "", "%\nO1\n", "<html>"):
        program = read_program(text)
        assert program.fault
        assert (program.blocks, program.steps) == ((), ())


def test_what_a_tool_call_names() -> None:
    cases = {
        "TOOL CALL 5 Z S8500": ("5", "8500"),
        "TOOL CALL 5.1 Z S8500 F200 DL+0.1": ("5.1", "8500"),
        'TOOL CALL "MILL; D10" Z S Q5 ; "FINISH"': ('"MILL; D10"', "Q5"),
        "TOOL CALL Q5 Z S+Q6": ("Q5", "+Q6"),
        "TOOL CALL QS1 Z": ("QS1", ""),
        "TOOL CALL Z S4000": ("", "4000"),
        "TOOL CALL S4000": ("", "4000"),
        "TOOL CALL 0 Z": ("0", ""),
        "TOOL CALL": ("", ""),
    }
    for block, expected in cases.items():
        (step, _) = read_program(program_of(block)).steps
        assert (step.kind, step.word, step.speed) == (Kind.TOOL_CALL, *expected), block


def test_labels_calls_jumps_and_ends() -> None:
    blocks = {
        "LBL 5": (Kind.LABEL, "5"),
        'LBL "POCKET" ; TOOL CALL 7': (Kind.LABEL, '"POCKET"'),
        "CALL LBL 5": (Kind.CALL, "5"),
        "CALL LBL 5 REP 3": (Kind.REPEAT, "5"),
        "CALL LBL 5 REP3": (Kind.REPEAT, "5"),
        "FN 12: IF +Q1 LT +Q2 GOTO LBL 5": (Kind.JUMP, "5"),
        'FN9: IF +Q1 EQU +Q2 GOTO LBL "POCKET"': (Kind.JUMP, '"POCKET"'),
        "CALL PGM TNC:\\nc_prog\\SUB.H": (Kind.PROGRAM, ""),
        "CYCL DEF 12.1 PGM SUB.H": (Kind.PROGRAM, ""),
        "L Z+100 R0 FMAX M30": (Kind.END, ""),
        "M2": (Kind.END, ""),
    }
    for block, expected in blocks.items():
        (step, *_) = read_program(program_of(block)).steps
        assert (step.kind, step.word) == expected, block
    for block in ("L X+20 M3", "; TOOL CALL 5", "TOOL DEF 6", "L X+1 M200", "Q2 = 30"):
        assert [step.kind for step in read_program(program_of(block)).steps] == [Kind.END], block


def test_a_block_that_may_be_skipped_is_known_as_such() -> None:
    assert read_program("0 BEGIN PGM P MM\n/1 TOOL CALL 5 Z\n2 END PGM P MM\n").steps[0].may_skip


def test_a_program_with_structured_jumps_is_shown_but_not_followed() -> None:
    program = read_program(program_of("IF +Q1 EQU +Q2 THEN", "TOOL CALL 5 Z", "END IF"))
    assert (program.block(2), program.fault) == ("TOOL CALL 5 Z", "block 1 is a structured jump, which is not followed")


@given(
    st.text(max_size=300) | st.lists(st.sampled_from(["0 ", "1 ", "TOOL CALL", " LBL 5\n", "~\n", '"', ";", "\n"])).map("".join)
)
def test_any_text_is_a_program_or_has_a_fault(text: str) -> None:
    program = read_program(text)
    assert bool(program.blocks) or program.fault
