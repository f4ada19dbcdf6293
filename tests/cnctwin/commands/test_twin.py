"""The twin from the command line: figures, files, and one line for what is wrong."""

import io
import json
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import pytest

from cnctwin.cli import main
from tests.twin.simulator.test_simulation import MACHINE, SLOT
from twin.machine import read_machine
from twin.machine_toml import machine_to_toml
from twin.runlog import read_run, write_run
from twin.simulator.simulation import simulate


class Done(NamedTuple):
    """What came of a command."""

    returncode: int
    stdout: str
    stderr: str


def cnctwin(*arguments: object, cwd: Path = Path()) -> Done:
    """The command, run to its end in this process, which has loaded and compiled what it needs."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", ["cnctwin", *map(str, arguments)])
        patch.chdir(cwd)
        with pytest.raises(SystemExit) as ended:
            main()
    return Done(int(ended.value.code or 0), out.getvalue(), err.getvalue())


def test_a_process_of_its_own_says_the_same(folder: Path) -> None:
    arguments = ("simulate", "slot.nc", "--machine", "machine.toml", "--json")
    command = [sys.executable, "-m", "cnctwin", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert done.stderr == ""
    assert json.loads(done.stdout) == json.loads(cnctwin(*arguments, cwd=folder).stdout)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "slot.nc").write_text(SLOT)
    (tmp_path / "machine.toml").write_text(machine_to_toml(MACHINE))
    return tmp_path


def test_simulate_prints_time_force_and_following_error_and_writes_the_run(folder: Path) -> None:
    done = cnctwin("simulate", folder / "slot.nc", "--machine", folder / "machine.toml", "--out", folder / "run.parquet")
    assert done.returncode == 0, done.stderr
    for word in ("following error X", "torque command Z", "cutting force", "spindle load", "rms", "peak"):
        assert word in done.stdout
    run = read_run(folder / "run.parquet")
    assert run.has("x_pos_mm", "force_x_n", "spindle_load_pct", "spindle_temp_c", "tool_number")
    again = cnctwin("simulate", folder / "slot.nc", "--machine", folder / "machine.toml", "--json")
    summary = json.loads(again.stdout)
    assert summary["cutting_force_n"]["peak"] == pytest.approx(27.50, abs=0.01)
    assert summary["seconds"] == pytest.approx(run.t_s[-1], abs=0.002)


LEARNED = """
[[effects]]
effect = "learned"
site = "axis_force"
on = "x"
unit = "N"
depends_on = ["position"]
repeats = true
closure = 0.81
sentence = "a force on X"
table = { position_mm = [0.0, 40.0], value = [50.0, 50.0], low = [40.0, 40.0], high = [60.0, 60.0] }
"""
OF_A_RECORDING = """
[[effects]]
effect = "learned"
site = "axis_force"
on = "x"
table = { t_s = [0.0, 0.1], run = ["runs/1.parquet", "runs/1.parquet"], value = [0.0, 50.0] }
"""


def test_simulate_takes_a_learned_term_and_says_which_one_it_leaves_out(folder: Path) -> None:
    (folder / "learned.toml").write_text((folder / "machine.toml").read_text() + LEARNED + OF_A_RECORDING)
    bare, learned = (
        json.loads(cnctwin("simulate", "slot.nc", "--machine", f"{name}.toml", "--json", cwd=folder).stdout)
        for name in ("machine", "learned")
    )
    assert learned != bare
    left_out = "the learned term at axis_force on x describes the time of a recording; it is left out"
    assert [note for note in learned["notes"] if note not in bare["notes"]] == [left_out]


def test_identify_writes_a_machine_that_can_be_read(folder: Path) -> None:
    (folder / "machine.toml").write_text((folder / "machine.toml").read_text() + LEARNED)
    (folder / "runs").mkdir()
    air = MACHINE.model_copy(update={"axes": {"x": MACHINE.axes["x"]}, "stock": None})
    entries = ""
    for seed, role in ((1, "fit"), (2, "check")):
        run = simulate(air, "G4 P200\nG1 X5 F1500\nG1 X0\nG1 X20 F6000\nG1 X0\nG4 P300\nM30\n", seed=seed).run
        write_run(run, folder / f"runs/{seed}.parquet")
        entries += f"[[runs]]\nfile = 'runs/{seed}.parquet'\nkind = 'air'\nrole = '{role}'\n"
    (folder / "case.toml").write_text(f"[case]\nname = 'c'\nmachine = 'machine.toml'\n{entries}")
    done = cnctwin("identify", folder, "--out", folder / "out.toml")
    assert done.returncode == 0, done.stderr
    assert "axes.x.mass_kg" in done.stdout
    assert "not to be known from these recordings" in done.stdout
    found = read_machine(folder / "out.toml")
    assert found.axes["x"].mass_kg == pytest.approx(300.0, rel=0.02)
    assert found.learned == read_machine(folder / "machine.toml").learned
    answer = json.loads(cnctwin("identify", folder, "--json").stdout)
    assert {e["path"] for e in answer["estimates"]} >= {"axes.x.mass_kg", "axes.x.friction.coulomb_n"}


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("simulate", "none.nc", "--machine", "machine.toml"), "none.nc: cannot be read"),
        (("simulate", "slot.nc", "--machine", "none.toml"), "none.toml: cannot be read"),
        (("simulate", "bad.nc", "--machine", "machine.toml"), "bad.nc: line 2"),
        (
            ("simulate", "slot.nc", "--machine", "machine.toml", "--out", "no/where.parquet"),
            "no/where.parquet: cannot be written",
        ),
        (("identify", "."), "case.toml: cannot be read"),
        (("import", "slot.nc", "--out", "run.parquet"), "slot.nc"),
    ],
)
def test_wrong_input_gets_one_line_and_exit_code_2(folder: Path, arguments: tuple[str, ...], complaint: str) -> None:
    (folder / "bad.nc").write_text("G1 X10 F100\nG2 X20 R1\n")
    done = cnctwin(*arguments, cwd=folder)
    assert done.returncode == 2
    assert complaint in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
