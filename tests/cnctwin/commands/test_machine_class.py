"""A class of machine stands in for a machine.toml that nobody has written yet."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cnctwin.cli import app
from cnctwin.commands.options import file_or_class
from cnctwin.machines.starters import CLASSES, machine_classes
from twin.machine import read_machine

PROGRAM = "G90 G94 G21\nG1 X2. F2000\nM30\n"


def test_a_program_is_simulated_on_a_class_and_the_answer_says_what_is_assumed(tmp_path: Path) -> None:
    program = tmp_path / "part.nc"
    program.write_text(PROGRAM)
    done = CliRunner().invoke(app, ["simulate", str(program), "--machine", "vmc-40", "--json"])
    assert done.exit_code == 0, done.output
    assert any("54 constants" in note for note in json.loads(done.output)["notes"])


@pytest.mark.parametrize("machine_class", machine_classes())
def test_a_machine_of_a_class_is_called_by_it(machine_class: str) -> None:
    assert read_machine(file_or_class(Path(machine_class))).machine.name == machine_class


def test_a_lathe_has_nothing_to_optimise_and_says_so_at_once(tmp_path: Path) -> None:
    command = [
        "optimise",
        "docs/notebooks/pocket.nc",
        "--machine",
        "lathe",
        "--out",
        str(tmp_path / "a.nc"),
        "--feed-range",
        "1:9",
    ]
    done = CliRunner().invoke(app, command)
    assert str(done.exception).startswith("no [tool]: no force is computed, so that there is nothing to choose")


def test_a_file_of_that_name_goes_before_the_class(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert file_or_class(Path("vmc-40")) == CLASSES / "vmc-40.toml"
    Path("vmc-40").write_text("")
    assert file_or_class(Path("vmc-40")) == Path("vmc-40")
    assert file_or_class(Path("mill.toml")) == Path("mill.toml")


@pytest.mark.parametrize(("options", "least_n"), [((), None), (("--stock", "0:80,0:60,-20:0"), 50.0)])
def test_a_class_cuts_where_the_command_states_the_block(options: tuple[str, ...], least_n: float | None) -> None:
    done = CliRunner().invoke(app, ["simulate", "docs/notebooks/pocket.nc", "--machine", "vmc-40", "--json", *options])
    assert done.exit_code == 0, done.output
    force = json.loads(done.stdout).get("cutting_force_n")
    assert force is None if least_n is None else force["peak"] > least_n
