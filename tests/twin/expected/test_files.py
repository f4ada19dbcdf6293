"""A file gives back what was written, and says it where it is damaged or stale."""

from pathlib import Path

import pytest

from tests.twin.expected.machines import PLATE, machine
from twin.errors import ExpectationError
from twin.expected.files import from_json, load_expectations, read_expectation, stale, to_json, written
from twin.expected.making import expectation_of, text_sha256


def test_what_is_read_expects_what_was_written(tmp_path: Path) -> None:
    made = expectation_of(machine(), PLATE, name="O12", description="d1")
    path = written(tmp_path, made)
    assert path == tmp_path / "small" / "O12.json"
    read = load_expectations(tmp_path)["small"]["/PRG/O0012.NC"]
    assert (read.runs, read.meter, read.basis, read.numbering) == (made.runs, made.meter, made.basis, made.numbering)
    assert [read.at(line, 900.0, 3900.0) for line in made.runs_of_line] == [
        made.at(line, 900.0, 3900.0) for line in made.runs_of_line
    ]


@pytest.mark.parametrize(
    ("before", "after", "why"),
    [
        ('"version":1', '"version":9', "version 9 is not 1"),
        ('"small"', '"other"', "its checksum is not that of what it holds"),
        ('{"version"', "", "is no expectation"),
    ],
)
def test_a_damaged_file_is_refused_and_named(tmp_path: Path, before: str, after: str, why: str) -> None:
    path = tmp_path / "O1.json"
    path.write_text(to_json(expectation_of(machine(), PLATE)).replace(before, after, 1), encoding="utf-8")
    with pytest.raises(ExpectationError, match=rf"O1\.json: {why}"):
        read_expectation(path)


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ExpectationError, match="no such folder"):
        load_expectations(tmp_path / "none")


def test_a_changed_program_or_description_is_told() -> None:
    made = from_json(to_json(expectation_of(machine(), PLATE, name="O12", description="d1")))
    assert stale(made, program_sha256=text_sha256(PLATE.replace("\n", "\r\n")), description="d1") is None
    assert "program O12 has changed" in (stale(made, program_sha256=text_sha256(PLATE + "M5")) or "")
    assert "description of small has changed" in (stale(made, description="d2") or "")
