"""Programs are found by the names that controls tell."""

from pathlib import Path

import pytest

from cnctwin.errors import UsageError
from cnctwin.files.program_folder import ProgramFolder


@pytest.mark.parametrize(
    ("file", "text", "program"),
    [
        ("PLATE.NC", "G0", "PLATE.NC"),
        ("plate.nc", "G0", "PLATE"),
        ("o1701.nc", "G0", "O01701"),
        ("base plate.txt", "%\nO1701 (BASE)\nG0\n", "1701"),
        ("any.h", "BEGIN PGM BRACKET MM\n", "BRACKET"),
        ("part.mpf", "G0", "/_N_MPF_DIR/PART.MPF"),
    ],
)
def test_the_text_of_a_program_is_found_by_the_name_that_the_control_gives_it(
    tmp_path: Path, file: str, text: str, program: str
) -> None:
    (tmp_path / file).write_text(text)
    assert ProgramFolder(tmp_path).text_of(program) == text
    assert ProgramFolder(tmp_path).text_of("another") is None and ProgramFolder(None).text_of(program) is None


def test_a_folder_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such folder with NC files"):
        ProgramFolder(tmp_path / "nowhere")
