"""The programs of real recordings run whole, and their lengths are those that were measured."""

import math

import pytest

from tests.recordings import recording, recordings_folder
from twin.programs import Arc, Linear, Move, ProgramEnd, ProgramStop, Rapid, Settings, ToolChange
from twin.programs.fanuc.interpreter import interpret

PLATES = (1, 2, 3, 4, 10, 11, 13, 14, 15, 19)
NAMES = (*(f"NIST_MTC_CRADA_PLATE-{number}" for number in PLATES), "NIST_MTC_CRADA_COVER_REV-A", "BOX_OP1")
FIRST_DRILL_LINE, LAST_DRILL_LINE = 2963, 2966
"""The G81 of PLATE-1, 0-based."""


def text_of(name: str) -> str:
    return recording(f"nist/nc/{name}.NC").read_text()


def lengths_inch(moves: list[Move]) -> tuple[float, float, float]:
    """Cutting, of which in the drill cycle, and rapid."""
    cutting = drilling = rapid = 0.0
    here: tuple[float, ...] = (0.0, 0.0, 0.0)
    for move in moves:
        if not isinstance(move, Rapid | Linear | Arc):
            continue
        length = math.dist(here, move.end_mm)
        if isinstance(move, Arc):
            assert move.plane == 17
            turned = abs(move.sweep_rad) * math.dist(here[:2], move.centre_mm[:2])
            length = math.hypot(turned, move.end_mm[2] - here[2])
        if isinstance(move, Rapid):
            rapid += length
        else:
            cutting += length
            drilling += length if FIRST_DRILL_LINE <= move.line <= LAST_DRILL_LINE else 0.0
        here = move.end_mm
    return cutting / 25.4, drilling / 25.4, rapid / 25.4


@pytest.mark.parametrize("name", NAMES)
def test_a_shop_program_runs_whole(name: str) -> None:
    text = text_of(name)
    moves = interpret(text)
    lines = text.splitlines()
    assert isinstance(moves[-1], ProgramEnd)
    changes = [move.line for move in moves if isinstance(move, ToolChange)]
    assert changes == [at for at, line in enumerate(lines) if line.endswith("M6")]
    # Every block that names a place to go to has moved, on its own line.
    named = {at for at, line in enumerate(lines) if line.startswith("N") and any(letter in line for letter in "XYZ")}
    assert {move.line for move in moves if isinstance(move, Rapid | Linear | Arc)} == named


def test_the_length_of_plate_1_is_the_measured_one() -> None:
    cutting, drilling, rapid = lengths_inch(interpret(text_of("NIST_MTC_CRADA_PLATE-1")))
    # The 563.7 inch that are stated of it leave out the drill cycle: four holes of 0.27 inch each.
    assert drilling == pytest.approx(4 * 0.27, abs=1e-9)
    assert cutting - drilling == pytest.approx(563.7, abs=0.06)
    # From machine zero, with home at zero; agreed move by move with rs274.
    assert rapid == pytest.approx(165.29, abs=0.01)


def test_the_optional_stops_of_a_plate_follow_the_switch() -> None:
    text = text_of("NIST_MTC_CRADA_PLATE-1")
    stops = [move.line for move in interpret(text, Settings(optional_stop=True)) if isinstance(move, ProgramStop)]
    assert stops == [at for at, line in enumerate(text.splitlines()) if "M01" in line]


def test_the_programs_of_the_cases_run_whole() -> None:
    paths = sorted((recordings_folder().parent / "cases").glob("*/runs/*.nc"))
    if not paths:
        pytest.skip(f"no cases beside {recordings_folder()}")
    for path in paths:
        moves = interpret(path.read_text())
        assert isinstance(moves[-1], ProgramEnd), path.name
        assert any(isinstance(move, Linear | Arc) for move in moves), path.name
