"""`cnctwin expect`: works a program out once, and says what is left out."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from cnctwin.cli import app
from tests.twin.expected.machines import MACHINE, PLATE
from twin.expected.files import read_expectation

TOOLS = """
[tools.2]
diameter_mm = 5.0
teeth = 2
tangential_coefficient_n_per_mm2 = 900.0
radial_ratio = 0.3
"""


@pytest.fixture(name="folder")
def folder_fixture(tmp_path: Path) -> Path:
    (tmp_path / "small.toml").write_text(MACHINE, encoding="utf-8")
    (tmp_path / "O12.nc").write_text(PLATE.replace("S4000 M3", "T2 M6\nS4000 M3"), encoding="utf-8")
    (tmp_path / "tools.toml").write_text(TOOLS, encoding="utf-8")
    return tmp_path


def run(folder: Path, *more: str) -> list[dict[str, Any]]:
    arguments = [
        "expect",
        str(folder / "O12.nc"),
        "--machine",
        str(folder / "small.toml"),
        "--out",
        str(folder / "out"),
        "--json",
    ]
    result = CliRunner().invoke(app, [*arguments, *more])
    assert result.exit_code == 0, result.output
    return list(json.loads(result.stdout))


def test_a_program_is_worked_out_once_and_again_where_it_has_changed(folder: Path) -> None:
    (first,) = run(folder)
    assert first["out"] == str(folder / "out" / "small" / "O12.json")
    assert (run(folder)[0]["out"], run(folder, "--fresh")[0]["out"]) == (None, first["out"])
    assert run(folder, "--tools", str(folder / "tools.toml"))[0]["out"] == first["out"]
    assert run(folder, "--tools", str(folder / "tools.toml"))[0]["out"] is None
    (folder / "O12.nc").write_text(PLATE, encoding="utf-8")
    assert run(folder, "--tools", str(folder / "tools.toml"))[0]["out"] == first["out"]


def test_tools_of_a_file_and_lines_as_the_control_counts_them(folder: Path) -> None:
    run(folder, "--tools", str(folder / "tools.toml"), "--lines", "from_1", "--name", "vmc-7")
    made = read_expectation(folder / "out" / "vmc-7" / "O12.json")
    assert {run.diameter_mm for run in made.runs if run.diameter_mm} == {5.0}
    assert made.basis[0] == "lines counted from 1, tools 2"


def test_programs_that_differ_in_their_ending_alone_do_not_overwrite_one_another(folder: Path) -> None:
    (folder / "O0012.mpf").write_text("N10 S4000 M3\nN20 G1 X5 F500\nN30 M30\n", encoding="utf-8")
    (folder / "more").mkdir()
    (folder / "more" / "O12.mpf").write_text("N10 S4000 M3\nN20 G1 X5 F500\nN30 M30\n", encoding="utf-8")
    where = ["--machine", str(folder / "small.toml"), "--out", str(folder / "out")]
    both = CliRunner().invoke(app, ["expect", str(folder / "O12.nc"), str(folder / "O0012.mpf"), *where])
    assert both.exit_code != 0
    assert "O12.nc and O0012.mpf are one program" in str(both.exception)
    assert not (folder / "out").exists()
    run(folder)
    before = (folder / "out" / "small" / "O12.json").read_bytes()
    later = CliRunner().invoke(app, ["expect", str(folder / "more" / "O12.mpf"), *where, "--fresh"])
    assert "O12.nc and O12.mpf are one program" in str(later.exception)
    assert (folder / "out" / "small" / "O12.json").read_bytes() == before


@pytest.mark.parametrize(
    ("more", "why"),
    [
        (["--lines", "some"], "--lines some is not known; give auto, n_words, from_0, from_1"),
        (["--tools", "small.toml"], "has no [tools.N]; write one for each tool"),
    ],
)
def test_a_wrong_option_is_named(folder: Path, more: list[str], why: str) -> None:
    given = [str(folder / one) if one.endswith(".toml") else one for one in more]
    arguments = ["expect", str(folder / "O12.nc"), "--machine", str(folder / "small.toml"), "--out", str(folder / "out")]
    result = CliRunner().invoke(app, [*arguments, *given])
    assert why in str(result.exception)
