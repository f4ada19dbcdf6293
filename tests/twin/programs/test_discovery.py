"""How the language of a program is told."""

import pytest

from twin.errors import PartProgramError, TwinError
from twin.programs import Settings, interpret
from twin.programs.discovery import dialect_of, dialects, named, told_by_ending


def test_fanuc_is_found_in_its_folder() -> None:
    assert dialects()["fanuc"] is named("fanuc")


def test_plain_g_code_is_taken_for_fanuc() -> None:
    assert dialect_of("G90 G1 X10 F100\nM30\n").name == "fanuc"


def test_an_empty_program_makes_no_moves() -> None:
    assert interpret("\n \n") == []


def test_a_text_in_no_language_is_refused_with_the_ones_that_there_are_and_the_way_to_choose() -> None:
    with pytest.raises(PartProgramError, match=r"^line 2: <\?xml version: .*fanuc \(FANUC.*dialect = ") as caught:
        interpret("\n<?xml version\n")
    assert caught.value.word == "<?xml version"


def test_the_settings_decide_where_they_name_a_language() -> None:
    assert dialect_of("<?xml", Settings(dialect="fanuc")).name == "fanuc"
    with pytest.raises(TwinError, match=r"dialect 'mazatrol' is not known; known are fanuc \("):
        interpret("G1", Settings(dialect="mazatrol"))


@pytest.mark.parametrize(
    ("text", "ending", "dialect", "told"),
    [
        ("G54 G17 G90\nT1 D1 M6\nM30\n", ".MPF", None, "sinumerik"),
        ("G54 G17 G90\nT1 D1 M6\nM30\n", ".mpf", "fanuc", "fanuc"),
        ("L X+10 F600\n", ".h", None, "klartext"),
        ("BEGIN PGM A MM\nEND PGM A MM\n", ".mpf", None, None),
        ("G54 G17 G90\nM30\n", ".nc", None, None),
        ("G54 G17 G90\nM30\n", ".xyz", None, None),
    ],
)
def test_the_ending_of_a_file_tells_a_language_unless_the_text_is_surely_another(
    text: str, ending: str, dialect: str | None, told: str | None
) -> None:
    assert told_by_ending(text, ending, dialect) == told
