"""How the language of a program is told."""

import pytest

from twin.errors import PartProgramError, TwinError
from twin.programs import Settings, interpret
from twin.programs.discovery import dialect_of, dialects, named


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
