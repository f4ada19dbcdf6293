"""`cnctwin gap case`: what a program and a person read, and one line for what is wrong."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cnctwin.cli import main
from cnctwin.standins.simulated_machine.description import TOLD
from tests.cnctwin.composing.made_up import store_of_days
from twin.machine import read_machine
from twin.runlog import run_log, write_run


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder = tmp_path_factory.mktemp("history") / "store"
    store_of_days(folder, 2).close()
    yield str(folder)


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    with pytest.MonkeyPatch.context() as patched, pytest.raises(SystemExit) as ended:
        patched.setattr(sys, "argv", ["cnctwin", "gap", "case", *(str(a) for a in arguments)])
        main()
    said = capsys.readouterr()
    return int(ended.value.code or 0), said.out, said.err


def test_a_program_reads_runs_and_what_they_can_show(place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "case"
    asked = ("--store", place, "--machine", "vmc", "--machine-file", TOLD, "--out", out, "--json")
    code, told, _ = run(capsys, *asked)
    done = json.loads(told)
    assert code == 0 and done["case"] == str(out) and {r["role"] for r in done["runs"]} == {"fit", "check"}
    missing = {one["effect"]: one["missing"] for one in done["effects"]}
    assert missing["coolant_cooling"] == "" and missing["gravity"].startswith("no reference and torque of an axis")


def test_a_person_reads_a_table_and_what_is_missing(place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, told, _ = run(capsys, "--store", place, "--machine", "vmc", "--machine-file", TOLD, "--out", tmp_path / "case")
    assert code == 0 and "warmup" in told and "can show" in told
    assert "no program with its NC text (--programs DIR)" in told


def test_a_machine_that_nobody_described_is_assumed(place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, _ = run(capsys, "--store", place, "--machine", "vmc", "--out", tmp_path / "case", "--json")
    assert code == 0 and 'assumed = ["spindle", "thermal"]' in (tmp_path / "case" / "machine.toml").read_text()


def test_the_folder_of_machines_describes_it(
    place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    machines = tmp_path / "machines"
    machines.mkdir()
    (machines / "vmc.toml").write_text(TOLD.read_text())
    monkeypatch.setenv("CNCTWIN_MACHINES", str(machines))
    run(capsys, "--store", place, "--machine", "vmc", "--out", tmp_path / "case", "--json")
    assert (tmp_path / "case" / "machine.toml").read_text() == TOLD.read_text()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((), "name run logs, or a machine of the store"),
        (("--machine", "vmc", "--fit", "a"), "--fit belongs to run logs"),
        (("--machine", "lathe"), "lathe: the store has no signal of it"),
        (("--machine", "vmc", "--from", "yesterday"), "--from 'yesterday' is no moment"),
        (("--machine", "vmc", "--from", "2026-01-02", "--to", "2026-01-01"), "is not after --from"),
        (("--machine", "vmc", "--from", "2020-01-01", "--to", "2020-01-02"), "nothing of it in that stretch"),
        (("--machine", "vmc", "--healthy-from", "2026-01-02"), "--healthy-from and --healthy-to belong together"),
        (("--machine", "vmc", "--programs", "nowhere"), "nowhere: there is no such folder with NC files"),
        (("--machine", "vmc", "--machine-file", "nowhere.toml"), "nowhere.toml: cannot be read"),
    ],
)
def test_wrong_input_is_one_line(
    place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], says: str
) -> None:
    code, told, error = run(capsys, "--store", place, *arguments, "--out", tmp_path / "case")
    assert code == 2 and not told and says in error and len(error.strip().splitlines()) == 1
    assert not any(tmp_path.iterdir())


@pytest.fixture
def runs(tmp_path: Path) -> list[Path]:
    """Three run logs of one axis."""
    t_s = np.arange(2000) * 0.001
    paths = []
    for name, size in (("a", 1.0), ("b", 1.0), ("c", 2.0)):
        motion = size * np.sin(2.0 * np.pi * t_s)
        paths.append(tmp_path / f"{name}.csv")
        write_run(run_log({"t_s": t_s, "x_ref_mm": motion, "x_pos_mm": motion, "x_torque_a": motion}), paths[-1])
    return paths


def test_run_logs_become_a_case_as_options_say(runs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = ("--fit", "c", "--check", "a.csv", "--repeats", "b=a", "--kind", "c=air", "--healthy", runs[1])
    code, told, _ = run(capsys, *runs, "--machine-file", TOLD, "--out", tmp_path / "case", *said, "--json")
    done = {r["file"]: (r["role"], r["repeats"], r["healthy"]) for r in json.loads(told)["runs"]}
    assert code == 0 and done == {
        "runs/a.parquet": ("check", None, False),
        "runs/b.parquet": ("check", "runs/a.parquet", True),
        "runs/c.parquet": ("fit", None, False),
    }


def test_without_a_judge_the_exit_code_is_1(runs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, _ = run(capsys, *runs[:2], "--machine-file", TOLD, "--out", tmp_path / "case")
    assert code == 1 and (tmp_path / "case" / "case.toml").is_file()


def test_on_a_terminal_it_asks(
    runs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = iter(["air", "fit", False, "nonsense", "air", "check", False, str(TOLD)])
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    monkeypatch.setattr("typer.prompt", lambda *_, **__: next(answers))
    monkeypatch.setattr("typer.confirm", lambda *_, **__: next(answers))
    code, told, _ = run(capsys, runs[0], runs[2], "--out", tmp_path / "case", "--json")
    assert code == 0 and [r["role"] for r in json.loads(told)["runs"]] == ["fit", "check"] and not list(answers)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((), "--machine machine.toml is missing"),
        (("--machine", "vmc-41"), "vmc-41: cannot be read"),
        (("--machine", "vmc-40", "--machine-file", TOLD), "two descriptions of one machine; give one"),
        (("--machine-file", TOLD, "--fit", "d"), "--fit d: no run log has this name; there are a, b, c"),
        (("--machine-file", TOLD, "--fit", "a", "--check", "a"), "nothing is fitted that is judged on"),
        (("--machine-file", TOLD, "--kind", "a"), "--kind a: write NAME=air, cut, warmup or program"),
        (("--machine-file", TOLD, "--kind", "a=drill"), "there is no such kind"),
        (("--machine-file", TOLD, "--program", "a=gone.nc"), "gone.nc: cannot be read"),
        (("--machine-file", TOLD, "--store", "s"), "--store belongs to a case from a store"),
        (("--machine-file", TOLD, "gone.parquet"), "gone.parquet: there is no such file"),
    ],
)
def test_wrong_input_for_run_logs_is_one_line(
    runs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[object, ...], says: str
) -> None:
    code, told, error = run(capsys, *runs, *arguments, "--out", tmp_path / "case")
    assert code == 2 and not told and says in error and len(error.strip().splitlines()) == 1
    assert not (tmp_path / "case").exists()


def test_one_command_fits_an_assumed_machine_from_the_store(
    place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "machine.toml"
    with pytest.MonkeyPatch.context() as patched, pytest.raises(SystemExit) as ended:
        patched.setattr(sys, "argv", ["cnctwin", "identify", "--store", place, "--machine", "vmc", "--out", str(out), "--json"])
        main()
    told = json.loads(capsys.readouterr().out)
    assert ended.value.code == 0 and told["out"] == str(out)
    machine = read_machine(out)
    assert "thermal.resistance_k_per_w" not in machine.machine.assumed and "thermal" not in machine.machine.assumed
    assert machine.thermal is not None
    assert abs(machine.thermal.resistance_k_per_w * machine.thermal.capacity_j_per_k - 640.0) < 64.0
