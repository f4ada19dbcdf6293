"""Whatever is wrong with what a user gives, one line on stderr says what and how to go on; the exit code is 2."""

import subprocess
import sys
from pathlib import Path

import pytest

from cnctwin.cli import main
from cnctwin.standins.simulated_machine.description import SPARE_PART
from processors.discovery import discover

NO_TOML = "[machine\n"
NO_SUCH_KEY = '[machine]\nname = "vmc"\ncolour = "blue"\n'
NO_SUCH_TABLE = "[spindle]\nrpm = 1\n"
PASSWORD = '[broker]\nurl = "mqtt://operator:hunter2@broker"\n'

# Arguments → what the line names. `FILE` is a file with the text beside it.
CASES = {
    "demo --recording /nonexistent": ("/nonexistent", ""),
    "demo --recording FILE": ("does not start", "no recording\n"),
    "demo --recording FILE --devices FILE": ("cannot be read as a device model", "no XML\n"),
    "demo --recording FILE --devices /nonexistent": ("/nonexistent", "no recording\n"),
    "demo --devices FILE": ("--recording", ""),
    "demo --speed 0": ("--speed 0", ""),
    "demo --speed nan": ("--speed nan", ""),
    "demo --speed 1000": ("--speed 1000", ""),
    "demo --speed fast": ("--speed", ""),
    "demo --seconds 0": ("--seconds 0", ""),
    "demo --port 70000": ("--port", ""),
    "demo --colour blue": ("--colour", ""),
    "edge run /nonexistent.toml": ("/nonexistent.toml", ""),
    "edge run FILE": ("no TOML", NO_TOML),
    "edge run": ("config", ""),
    "edge check FILE": ("colour", NO_SUCH_KEY),
    "edge discover http://127.0.0.1:1": ("http://127.0.0.1:1", ""),
    "edge discover nonsense": ("nonsense", ""),
    "plan fleet --machines 0": ("--machines", ""),
    "plan fleet --machines 5 --hz 0": ("--hz 0", ""),
    "plan fleet --machines 5 --processors nonsense": ("nonsense", ""),
    "process nonsense": ("thermal", ""),
    "process thermal --config /nonexistent.toml": ("/nonexistent.toml", ""),
    "process thermal --config FILE": ("spindle", NO_SUCH_TABLE),
    "process mirror --config FILE": ("line 1", NO_TOML),
    "watch --broker http://broker": ("mqtt://", ""),
    "watch --broker mqtt://operator:hunter2@broker": ("password", ""),
    "doctor --broker mqtt://broker:99999": ("99999", ""),
    "doctor --seconds 0": ("--seconds", ""),
    "doctor --bundle": ("'--bundle' requires an argument, as in --bundle bug.zip; see cnctwin doctor --help", ""),
    "gap check --keep": ("'--keep' requires an argument, as in --keep PATH; see cnctwin gap check --help", ""),
    "jobs submit --job": ("as in --job optimise; see cnctwin jobs submit --help", ""),
    "simulate-control mtconnect /nonexistent": ("/nonexistent", ""),
    "simulate-control mtconnect FILE": ("cannot be replayed", "no recording\n"),
    "simulate-control mtconnect RECORDING --style 9": ("'9'", ""),
    "simulate-control mtconnect RECORDING --speed -1": ("-1", ""),
    "simulate-control machine --speed 0": ("--speed 0", ""),
    "simulate-control machine --speed inf": ("--speed inf", ""),
    "nonsense": ("nonsense", ""),
}


def call(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["cnctwin", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


@pytest.mark.parametrize("line", [pytest.param(c, marks=pytest.mark.broker if c.startswith("demo") else ()) for c in CASES])
def test_wrong_input_is_one_line_and_exit_code_2(
    line: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    if line.startswith("demo"):
        request.getfixturevalue("mosquitto_program")
    named, content = CASES[line]
    file = tmp_path / "given.toml"
    file.write_text(content)
    words = line.replace("FILE", str(file)).replace("RECORDING", str(SPARE_PART)).split()
    assert call(monkeypatch, *words) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1, err
    assert err.startswith("cnctwin: ")
    assert named in err


def test_a_password_in_an_address_is_refused_and_not_repeated(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "vmc.toml"
    file.write_text(PASSWORD)
    for words in (("doctor", "--broker", "mqtt://operator:hunter2@broker"), ("edge", "run", str(file))):
        assert call(monkeypatch, *words) == 2
        err = capfd.readouterr().err
        assert len(err.splitlines()) == 1
        assert "environment variable" in err
        assert "hunter2" not in err


def test_a_real_process_says_it_without_a_traceback() -> None:
    done = subprocess.run([sys.executable, "-m", "cnctwin", "process", "nonsense"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr == f"cnctwin: no processor 'nonsense'; there are: {', '.join(discover())}\n"


@pytest.mark.parametrize(
    "words",
    [
        ["--help"],
        ["demo", "--help"],
        ["edge", "--help"],
        ["simulate-control", "mtconnect", "--help"],
        ["simulate-control", "machine", "--help"],
    ],
)
def test_every_command_explains_itself(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, *words) == 0
    assert "Usage" in capfd.readouterr().out


@pytest.mark.parametrize("words", [[], ["edge"]])
def test_a_command_without_its_command_shows_what_there_is(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, *words) == 2
    assert "Usage" in capfd.readouterr().out
