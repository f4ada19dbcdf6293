"""Remarks: a program that was cut off, and one that cuts with the spindle at rest, in each language."""

import pytest

from twin.programs.discovery import named
from twin.programs.remarks import remarks
from twin.programs.settings import Settings

WHOLE = {
    "fanuc": "%\nO0001\nG21 G90 S3000 M3\nG0 Z5.\nG1 Z-1. F200\nM30\n%",
    "klartext": "0 BEGIN PGM A MM\n1 TOOL CALL 1 Z S3000\n2 L Z+5 FMAX M3\n3 L Z-1 F200\n4 END PGM A MM",
    "sinumerik": "N10 G17 G90 S3000 M3\nN20 G0 Z5\nN30 G1 Z-1 F200\nN40 M30",
}


def said(language: str, text: str, met: frozenset[int] | None = None) -> tuple[str, ...]:
    dialect = named(language)
    return remarks(dialect, text, dialect.interpret(text, Settings(dialect=language)), met)


@pytest.mark.parametrize("language", WHOLE)
def test_nothing_is_remarked_of_a_whole_program(language: str) -> None:
    assert said(language, WHOLE[language]) == ()


@pytest.mark.parametrize(
    ("language", "gone", "last", "end"),
    [
        ("fanuc", "M30\n%", "line 5 is the last, 'G1 Z-1. F200'", "M30"),
        ("klartext", "4 END PGM A MM", "block 3 (line 4) is the last, '3 L Z-1 F200'", "END PGM"),
        ("sinumerik", "N40 M30", "line 3 (N30) is the last, 'N30 G1 Z-1 F200'", "M30"),
    ],
)
def test_a_program_that_was_cut_off_is_named_with_its_last_line(language: str, gone: str, last: str, end: str) -> None:
    (only,) = said(language, WHOLE[language].removesuffix(gone))
    assert only.startswith(last)
    assert f"no {end} follows" in only


def test_a_block_of_several_lines_is_named_by_its_number() -> None:
    (cut, _) = said("klartext", "0 BEGIN PGM A MM\n1 L X+5 F500\n2 CYCL DEF 200 DRILLING ~\n    Q200=2 ~\n    Q201=-5 ~")
    assert cut.startswith("block 2 (line 5) is the last, 'Q201=-5 ~'")


@pytest.mark.parametrize("language", WHOLE)
def test_cuts_without_a_spindle_are_named_with_the_first_of_them(language: str) -> None:
    (only,) = said(language, WHOLE[language].replace("M3\n", "\n"))
    assert only.startswith("nothing starts the spindle: the feed moves from ")
    assert ("block 3 (line 4)" if language == "klartext" else "line") in only


def test_where_the_stock_is_known_only_what_meets_it_is_a_cut() -> None:
    text = "G21 G90\nG1 X5. F200\nG1 Z-1.\nM30"
    assert said("fanuc", text, frozenset()) == ()
    (only,) = said("fanuc", text, frozenset({2}))
    assert only.startswith("nothing starts the spindle: the cuts from line 3 on have a spindle at rest")


@pytest.mark.parametrize("language", WHOLE)
def test_a_spindle_without_a_speed_is_named(language: str) -> None:
    (only,) = said(language, WHOLE[language].replace("S3000", ""))
    assert "starts the spindle without a speed" in only


@pytest.mark.parametrize(
    ("language", "text"),
    [
        ("fanuc", "%\nG21 G90 S100 M3\nG1 Z-1. F200\n%"),  # as LinuxCNC ends
        ("fanuc", "G21 G90\nG31 Z-1. F200\nM30"),  # it probes only
        ("fanuc", "G21 G90\nG0 Z5.\nM2"),
        ("klartext", "BEGIN PGM A MM\nL X+5 FMAX M30"),
        ("sinumerik", "G17 G90\nG0 X5\nRET"),
        ("sinumerik", "G17 G90\nG0 X5\nM17"),
    ],
)
def test_other_ends_are_ends(language: str, text: str) -> None:
    assert said(language, text) == ()
