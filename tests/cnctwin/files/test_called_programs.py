"""The programs beside a program."""

from pathlib import Path

import pytest

from cnctwin.files.called_programs import CalledPrograms
from twin.programs import Settings
from twin.vocabulary.program_names import ENDINGS

JOB_FORM = Path(__file__).parents[3] / "cnctwin/page/web/js/views/job_form.js"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in {"MAIN.MPF": "POCKET", "Pocket.SPF": "M17", "notes.pdf": "M30", "hole.h": "", "main.json": "{}"}.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "folder.spf").mkdir()
    return tmp_path


def test_programs_beside_it_are_found_by_name_and_what_is_no_program_is_not(folder: Path) -> None:
    called = CalledPrograms(folder / "MAIN.MPF")
    assert sorted(called) == ["hole", "pocket"]
    assert called["pocket"] == "M17"
    assert called.get("notes") is None
    assert "main" not in called


@pytest.mark.parametrize("name", ["POCKET", "pocket.spf", "/_N_SPF_DIR/POCKET.SPF", "TNC:\\parts\\Pocket.h"])
def test_a_call_names_a_program_with_folder_and_suffix_or_without(folder: Path, name: str) -> None:
    settings = Settings(programs=CalledPrograms(folder / "MAIN.MPF"))
    assert settings.called_text(name) == "M17"


def test_an_empty_program_is_there(folder: Path) -> None:
    assert Settings(programs=CalledPrograms(folder / "MAIN.MPF")).called_text("HOLE.H") == ""


def test_a_folder_that_is_not_there_holds_nothing(tmp_path: Path) -> None:
    assert list(CalledPrograms(tmp_path / "gone" / "main.nc")) == []


def test_the_job_form_of_the_page_offers_every_ending() -> None:
    assert f'fileOrName("program", "{",".join(ENDINGS)}")' in JOB_FORM.read_text(encoding="utf-8")
