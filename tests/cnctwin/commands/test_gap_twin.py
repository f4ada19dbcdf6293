"""A twin.toml has every table of the machine that it came from, so that whatever took the one takes the other."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.cnctwin.commands.test_gap import written
from tests.twin.gap.stages.produced import MACHINE, case_with
from tests.twin.optimisation.benchmark import FOLDER
from twin.machine import MachineFile, machine_from_toml, read_machine

KEPT = ("limits", "cost", "stock", "tool", "control", "noise")


def described() -> MachineFile:
    """The machine of the optimiser's benchmark with a spindle, whose idle power is assumed."""
    paper = (FOLDER / "optimise_paper.toml").read_text()
    machine = machine_from_toml(paper)
    assumed = machine.machine.model_copy(update={"assumed": ("spindle.idle_power_kw", "tool.radial_ratio")})
    known = {"spindle.idle_power_kw": 0.5, "relative": 0.05}
    more = {"spindle": MACHINE.spindle, "program": MACHINE.program, "uncertainty": known, "machine": assumed}
    return machine.model_copy(update={**more, "noise": {"spindle_load_pct": 0.2, "force_n": 3.0}})


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The twin.toml of a diagnosis of such a machine."""
    folder = written(case_with(described(), factor=1.4), tmp_path_factory.mktemp("twin") / "case")
    command = [sys.executable, "-m", "cnctwin", "gap", "diagnose", str(folder), "--out", str(folder / "out")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "out" / "twin.toml"


def test_every_table_is_kept(twin: Path) -> None:
    before, after = described(), read_machine(twin)
    for table in KEPT:
        assert getattr(after, table) == getattr(before, table), table
    assert after.uncertainty["relative"] == before.uncertainty["relative"]
    assert after.uncertainty["spindle.idle_power_kw"] < before.uncertainty["spindle.idle_power_kw"]
    assert {"limits", "cost", "stock", "noise"} <= tomllib.loads(twin.read_text()).keys()


def test_a_constant_that_was_fitted_is_assumed_no_longer(twin: Path) -> None:
    after = read_machine(twin)
    assert after.machine.assumed == ("tool.radial_ratio",)
    assert after.spindle is not None and MACHINE.spindle is not None
    assert after.spindle.idle_power_kw == pytest.approx(1.4 * MACHINE.spindle.idle_power_kw, rel=0.05)


def test_the_optimiser_takes_it(twin: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "cnctwin", "optimise", str(FOLDER / "optimise_paper.nc"), "--machine", str(twin)]
    quick = ["--evolutions", "2", "--population", "4", "--islands", "1", "--no-resimulation", "--objective", "cost"]
    command += [*quick, "--out", str(tmp_path / "optimised.nc")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "optimised.json").is_file()
