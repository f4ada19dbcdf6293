"""`cnctwin optimise` as a user types it."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from cnctwin.cli import main
from tests.twin.optimisation.benchmark import FOLDER, text
from twin.machine import machine_from_toml
from twin.machine_toml import machine_to_toml

PROGRAM, MACHINE = FOLDER / "optimise_paper.nc", FOLDER / "optimise_paper.toml"
Refused = Callable[..., str]
QUICK = ("--evolutions", "4", "--population", "8", "--islands", "1")


def optimise(*options: str | Path, program: Path = PROGRAM, machine: Path = MACHINE) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "cnctwin", "optimise", program, "--machine", machine, *QUICK, *options]
    return subprocess.run([str(one) for one in command], capture_output=True, text=True, timeout=300, check=False)


@pytest.fixture
def refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Refused:
    """The one line that the command says, in this process, and ends with this code."""

    def one_line(code: int, *options: str | Path, machine: Path = MACHINE) -> str:
        command = ["cnctwin", "optimise", PROGRAM, "--machine", machine, *QUICK, *options]
        monkeypatch.setattr(sys, "argv", [str(one) for one in command])
        with pytest.raises(SystemExit) as ended:
            main()
        said = capsys.readouterr().err
        assert ended.value.code == code
        assert said.count("\n") == 1
        return said

    return one_line


def test_it_writes_program_report_and_answer_and_says_what_they_are_worth(tmp_path: Path) -> None:
    done = optimise("--objective", "cost", "--force-limit-n", "60", "--out", tmp_path / "optimised.nc", "--paper")
    assert done.returncode == 0, done.stderr
    for said in ("29.48 s to 24.51 s (−16.9 %)", "120.1 to 76.39 KRW (−36.4 %)", "above the exact optimum", "60.0 N of 60 N"):
        assert said in done.stdout
    assert "the reference paper's own search" in done.stdout
    assert "S4584 M3" in (tmp_path / "optimised.nc").read_text()
    assert "<script" not in (tmp_path / "optimised.html").read_text()
    answer = json.loads((tmp_path / "optimised.json").read_text())
    assert answer["after"]["force_n"] <= 60.0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["optimised.html", "optimised.json", "optimised.nc"]


def test_a_program_may_read_the_answer_and_bytes_of_comments_stay(tmp_path: Path) -> None:
    program = tmp_path / "latin.nc"
    program.write_bytes(PROGRAM.read_bytes().replace(b"(BENCHMARK", b"(\xd8 6 BENCHMARK").replace(b"\n", b"\r\n"))
    done = optimise("--json", "--out", tmp_path / "out.nc", program=program)
    assert json.loads(done.stdout)["after"]["seconds"] == pytest.approx(24.51, abs=0.005)
    written = (tmp_path / "out.nc").read_bytes()
    assert b"(\xd8 6 BENCHMARK" in written
    assert written.count(b"\r\n") == program.read_bytes().count(b"\r\n")


def test_one_speed_for_a_tool_is_asked_for_and_told(tmp_path: Path) -> None:
    done = optimise("--speed-changes", "per_tool", "--out", tmp_path / "out.nc", "--no-resimulation")
    assert done.returncode == 0, done.stderr
    assert "29.48 s to 24.51 s" in done.stdout
    assert "note: one speed for each tool: 4584 rev/min" in done.stdout
    answer = json.loads((tmp_path / "out.json").read_text())
    assert (answer["speed_changes"], answer["changes_in_material"]) == ("per_tool", 0)
    assert "one speed for each tool number" in (tmp_path / "out.html").read_text()


@pytest.mark.parametrize(
    ("options", "code", "says"),
    [
        (("--objective", "speed"), 2, "--objective speed: is not known; it is time, cost or pareto"),
        (("--speed-changes", "never"), 2, "--speed-changes never: is not known; it is anywhere, in_air or per_tool"),
        (("--force-limit-n", "0"), 2, "the force limit is 0.0 N"),
        (("--force-limit-n", "1"), 1, "line 7: even 100 mm/min at 8000 rev/min give 6.9 N, more than 1 N"),
        (("--feed-range", "500"), 2, "--feed-range 500: is no range; write it as 100:3000"),
        (("--stock", "0:80,0:60"), 2, "--stock 0:80,0:60: is not a box; write the edges of the block as X0:X1,Y0:Y1,Z0:Z1 in mm"),
        (("--stock", "80:0,0:60,-20:0"), 2, "--stock 80:0,0:60,-20:0: min_mm 80.0 is not below max_mm 0.0 in x"),
        (("--pick", "1"), 2, "pick is 1, and the objective time; only a front has programs to pick from"),
        (("--leave", "9999"), 2, "line 9999 cannot be left alone: it is not a line that feeds"),
        (("--population", "5"), 2, "population is 5; it has to be even"),
        (("--probability", "2"), 2, "the probability is 2.0"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else None,
)
def test_what_is_wrong_is_one_line(tmp_path: Path, refused: Refused, options: tuple[str, ...], code: int, says: str) -> None:
    assert says in refused(code, *options, "--out", tmp_path / "out.nc")
    assert not (tmp_path / "out.nc").exists()


@pytest.mark.parametrize(
    ("out", "says"),
    [(".", "is a folder"), ("m.toml", "write the program under another name"), ("nowhere/o.nc", "there is no such folder")],
)
def test_a_place_where_the_answer_cannot_go_is_refused_at_once(tmp_path: Path, refused: Refused, out: str, says: str) -> None:
    machine = tmp_path / "m.toml"
    machine.write_bytes(MACHINE.read_bytes())
    assert says in refused(2, "--out", tmp_path / out, machine=machine)
    assert machine.read_bytes() == MACHINE.read_bytes()


def test_a_search_that_was_interrupted_goes_on(tmp_path: Path) -> None:
    """Ctrl-C in the middle of a long search leaves a checkpoint; the same command ends it."""
    out, kept = tmp_path / "out.nc", tmp_path / "out.checkpoint.json"
    machine = machine_from_toml(text("second.toml"))
    (tmp_path / "machine.toml").write_text(machine_to_toml(machine))
    command = [sys.executable, "-m", "cnctwin", "optimise", FOLDER / "optimise_second.nc", "--machine", tmp_path / "machine.toml"]
    options = ["--objective", "cost", "--evolutions", "80", "--out", out, "--no-resimulation"]
    process = subprocess.Popen([str(one) for one in [*command, *options]], stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120.0
    while not kept.exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "the same command goes on where it was" in said
    done = json.loads(kept.read_text())["done"]
    assert 0 < done < 80
    again = subprocess.run([str(one) for one in [*command, *options]], capture_output=True, text=True, timeout=300, check=False)
    assert again.returncode == 0, again.stderr
    assert out.exists()
    assert not kept.exists()
