"""The gap from the command line: files, figures, exit codes, and one line for what is wrong."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from cnctwin.cli import main
from tests.twin.gap.small_case import warm_case
from twin.case import Case
from twin.machine import AddedEffect, read_machine
from twin.machine_toml import machine_to_toml
from twin.runlog import run_log, write_run

SECOND = AddedEffect(effect="second_thermal_mass", parameters={"conductance_w_per_k": 4.0, "capacity_j_per_k": 4e4})
ENTRY = "[[runs]]\nfile = '{name}.parquet'\nkind = '{kind}'\nrole = '{role}'\n"


class Cnctwin:
    """The command, run in this process to its end."""

    def __init__(self, patch: pytest.MonkeyPatch, captured: pytest.CaptureFixture[str]) -> None:
        self._patch, self._captured = patch, captured

    def __call__(self, *arguments: object) -> tuple[int, str, str]:
        """Exit code, stdout, stderr."""
        self._patch.setattr(sys, "argv", ["cnctwin", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return int(ended.value.code or 0), *self._captured.readouterr()


@pytest.fixture
def cnctwin(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Cnctwin:
    """The command."""
    return Cnctwin(monkeypatch, capfd)


def written(case: Case, folder: Path) -> Path:
    """The case as a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    text = "[case]\nname = 'small'\nmachine = 'machine.toml'\n"
    for run in case.runs:
        name = run.name.replace(" ", "_")
        write_run(run.log, folder / f"{name}.parquet")
        text += ENTRY.format(name=name, kind=run.entry.kind.value, role=run.entry.role)
    (folder / "case.toml").write_text(text)
    (folder / "machine.toml").write_text(machine_to_toml(case.machine))
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A spindle whose heat flows on into the column, diagnosed into `out`."""
    folder = written(warm_case(SECOND), tmp_path_factory.mktemp("gap") / "case")
    command = [sys.executable, "-m", "cnctwin", "gap", "diagnose", str(folder), "--out", str(folder / "out"), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=180, check=False)
    assert done.returncode == 0, done.stderr
    (folder / "printed.json").write_text(done.stdout)
    return folder


def test_diagnose_writes_answer_page_and_twin_and_prints_the_answer(folder: Path) -> None:
    answer = json.loads((folder / "out/diagnosis.json").read_text())
    assert answer == json.loads((folder / "printed.json").read_text())
    assert answer["verdict"] == "explained"
    assert answer["causes"][0]["effect"] == "second_thermal_mass"
    assert answer["seconds"] > 0.0
    page = (folder / "out/report.html").read_text()
    assert page.lstrip().lower().startswith("<!doctype html")
    assert "second" in page
    assert read_machine(folder / "out/twin.toml").effects[0].effect == "second_thermal_mass"


def test_score_says_how_much_better_the_twin_is(folder: Path, cnctwin: Cnctwin) -> None:
    before, after = (
        json.loads(cnctwin("gap", "score", twin, folder, "--json")[1])
        for twin in (folder / "machine.toml", folder / "out/twin.toml")
    )
    assert after["gap"] < 0.3 * before["gap"]
    assert set(after["by_signal"]["spindle_temp_c"]) == {"rms", "floor", "unit"}
    assert after["by_signal"]["spindle_temp_c"]["unit"] == "°C"


def test_diagnose_prints_what_a_person_reads(folder: Path, cnctwin: Cnctwin) -> None:
    twin = folder / "out/twin.toml"
    again = written(warm_case(SECOND), folder.parent / "again")
    (again / "machine.toml").write_text(twin.read_text())
    code, out, err = cnctwin("gap", "diagnose", again, "--out", again / "out")
    assert code == 0, err
    assert out.startswith("Healthy")
    assert "× the repeatability" in out
    assert "diagnosis.json, report.html, twin.toml in" in out


def test_a_gap_without_a_name_is_exit_code_1(tmp_path: Path, cnctwin: Cnctwin) -> None:
    case = warm_case()
    runs = []
    for run in case.runs:
        columns = {"t_s": run.log.t_s} | dict(run.log.columns)
        swings = 6.0 * ((run.log.t_s % 700.0) > 350.0)  # of no cause that there is
        runs.append(type(run)(run.entry, run.folder, run_log(columns | {"spindle_temp_c": run.log["spindle_temp_c"] + swings})))
    folder = written(Case(case.name, case.machine, tuple(runs)), tmp_path / "case")
    code, out, err = cnctwin("gap", "diagnose", folder, "--out", folder / "out")
    assert code == 1, err
    assert out.startswith(("Unknown", "Partly"))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda f: (f / "case.toml").unlink(), "a case is a folder with a case.toml"),
        (lambda f: (f / "fit.parquet").unlink(), "fit.parquet is not there"),
        (lambda f: (f / "fit.parquet").write_bytes(b"no parquet"), "cannot be read as a run log"),
        (lambda f: (f / "machine.toml").write_text("[machine]\nname = 'm'\n"), "[thermal] in the machine's file"),
        (lambda f: _without(f, "spindle_rpm"), "not compared without spindle_rpm"),
        (lambda f: _without(f, "t_s"), "there is no column t_s"),
    ],
)
def test_what_is_wrong_is_one_line_and_exit_code_2(
    change: Callable[[Path], object], said: str, tmp_path: Path, cnctwin: Cnctwin
) -> None:
    case = written(warm_case(), tmp_path / "case")
    change(case)
    code, out, err = cnctwin("gap", "diagnose", case, "--out", tmp_path / "out")
    assert code == 2
    assert said in err
    assert len(err.splitlines()) == 1
    assert out == ""
    assert not (tmp_path / "out").exists()


def _without(folder: Path, column: str) -> None:
    for path in folder.glob("*.parquet"):
        pq.write_table(pq.read_table(path).drop_columns([column]), path)


def test_no_cases_to_check_is_exit_code_2(cnctwin: Cnctwin) -> None:
    code, _, err = cnctwin("gap", "check", "--cases", "0")
    assert code == 2
    assert "--cases" in err
