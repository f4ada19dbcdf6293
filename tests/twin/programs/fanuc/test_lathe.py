"""A lathe's program is refused at its first word that only a lathe has; a mill's program is not."""

import pytest

from cnctwin.machines.starters import starter_text
from twin.errors import PartProgramError
from twin.machine import machine_from_toml
from twin.programs.interpretation import interpret
from twin.simulator.simulation import simulate


@pytest.mark.parametrize(
    ("text", "line", "word"),
    [
        ("O0001\nG21 G99 G40\nG50 S2500\nT0101\nG96 S200 M3", 3, "G50 S2500"),
        ("G21 G99\r\n(T0202)\r\nT0101\r\nG97 S800 M3\r\nG0 X52. Z2.", 3, "T0101"),
        ("G0 X1.\nT0300", 2, "T0300"),
        ("T0101 M6\ng50s1800", 2, "g50s1800"),
        ("G21\nN10G0T0202", 2, "T0202"),
        ("N10G50S900", 1, "G50S900"),
    ],
)
def test_it_is_refused_at_its_first_word(text: str, line: int, word: str) -> None:
    with pytest.raises(PartProgramError, match=r"lathe \(G-code system A\)") as refused:
        interpret(text)
    assert (refused.value.line, refused.value.word) == (line, word)


@pytest.mark.parametrize(
    "text",
    [
        "T0101 M06\nG0 X1.",
        "N10T0202M6\nG0 X1.",
        "M6 T1010\nS800 M3",
        "(G50 S2500, T0101 of the other machine)\nG0 X1.",
        "G51 X0. Y0. P2.\nG1 X1. F100.\nG50\nS500",
        "#101=5\nG0 X#101",
        "T1012\nG0 X1.",
    ],
)
def test_a_mills_program_is_run(text: str) -> None:
    interpret(text)


def test_a_lathe_says_that_its_program_is_read_as_a_mills() -> None:
    notes = simulate(machine_from_toml(starter_text("lathe", "l")), "G21\nG1 X2. Z1. F600\nM30").notes
    assert "its program is read as a mill's, so X is a radius" in " ".join(notes)
