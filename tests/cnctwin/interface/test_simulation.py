"""A simulation in Python and the command: one service, one answer."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import cnctwin
from cnctwin.cli import main

NOTEBOOKS = Path(__file__).parents[3] / "docs" / "notebooks"
PROGRAM = NOTEBOOKS / "pocket.nc"


@pytest.fixture(scope="module")
def done() -> cnctwin.Simulated:
    return cnctwin.simulate(PROGRAM, NOTEBOOKS / "vmc.toml")


def test_it_says_what_the_command_says(
    done: cnctwin.Simulated, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run.parquet"
    asked = ["cnctwin", "simulate", str(PROGRAM), "--machine", str(NOTEBOOKS / "vmc.toml"), "--out", str(out), "--json"]
    monkeypatch.setattr(sys, "argv", asked)
    monkeypatch.setattr("cnctwin.cli.restrict", lambda _: None)
    with pytest.raises(SystemExit):
        main()
    told = json.loads(capsys.readouterr().out)
    assert {name: told[name] for name in done.figures.as_json()} == done.figures.as_json()
    assert cnctwin.read_run(out).table().equals(done.run.table())


def test_force_and_lag_are_those_of_the_run(done: cnctwin.Simulated) -> None:
    run = done.run
    assert done.seconds == pytest.approx(run.seconds, abs=0.01)
    assert done.peak_force_n == pytest.approx(run["cutting_force_peak_n"].max())
    lag_mm = max(np.abs(run[f"{axis}_ref_mm"] - run[f"{axis}_pos_mm"]).max() for axis in "xyz")
    assert done.peak_following_error_mm == pytest.approx(lag_mm)


def test_a_text_and_its_file_are_the_same_program(done: cnctwin.Simulated) -> None:
    machine = cnctwin.read_machine(NOTEBOOKS / "vmc.toml")
    assert cnctwin.simulate(PROGRAM.read_text(), machine).run.table().equals(done.run.table())


def test_in_air_there_is_no_force() -> None:
    machine = cnctwin.read_machine(NOTEBOOKS / "vmc.toml")
    assert cnctwin.simulate("G90 G21\nG1 Z10 F3000\nM30\n", machine).peak_force_n is None


def test_the_optimised_program_is_that_of_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = cnctwin.optimise(PROGRAM, NOTEBOOKS / "vmc.toml", force_limit_n=300.0, evolutions=10, resimulate=False)
    command = f"cnctwin optimise {PROGRAM} --machine {NOTEBOOKS / 'vmc.toml'} --out {tmp_path / 'a.nc'} --force-limit-n 300"
    monkeypatch.setattr(sys, "argv", [*command.split(), "--evolutions", "10", "--no-resimulation"])
    monkeypatch.setattr("cnctwin.cli.restrict", lambda _: None)
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    assert (tmp_path / "a.nc").read_text() == found.text
    found.write(tmp_path / "b.nc")
    assert (tmp_path / "b.nc").read_bytes() == (tmp_path / "a.nc").read_bytes()
    assert json.loads((tmp_path / "b.json").read_text())["bound"] == json.loads((tmp_path / "a.json").read_text())["bound"]
    with pytest.raises(cnctwin.UsageError, match="write the program under another name"):
        found.write(tmp_path / "b.html")
