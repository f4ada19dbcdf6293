"""Modes of the files of real commands under a lax umask: state is its owner's alone, what was asked for a group may read."""

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from sparkplug.broker import BrokerAddress
from tests.cnctwin.program import until
from tests.wire.mosquitto import Mosquitto

EDGE = """
[machine]
name = "vmc"
adapter = "mtconnect"
[broker]
url = "{broker}"
session_file = "{folder}/edges/vmc.json"
[mtconnect]
url = "http://127.0.0.1:1"
"""


def modes(folder: Path) -> dict[str, int]:
    return {
        str(path.relative_to(folder)): stat.S_IMODE(path.lstat().st_mode) for path in folder.rglob("*") if not path.is_symlink()
    }


def lax(*arguments: str, umask: int = 0o022, **given: object) -> subprocess.Popen[str]:
    """`cnctwin` as a person starts it who has never thought of a umask."""
    command = [sys.executable, "-c", f"import os; os.umask({umask}); from cnctwin.cli import main; main()", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **given)  # type: ignore[call-overload, no-any-return]


def end(process: subprocess.Popen[str]) -> None:
    process.terminate()
    process.communicate(timeout=60)


def test_state_is_its_owners_alone(mosquitto: Mosquitto, tmp_path: Path) -> None:
    broker = BrokerAddress(*mosquitto.address).url
    home = tmp_path / "made"
    environment = {
        **os.environ,
        "CNCTWIN_STATE_DIR": str(home / "state"),
        "CNCTWIN_STORE": str(home / "store"),
        "HOME": str(home),
    }
    (tmp_path / "vmc.toml").write_text(EDGE.format(broker=broker, folder=home))
    (tmp_path / "processors.toml").write_text(f'[historian]\nstore = "{home}/store"\n')
    commands = (
        ["process", "mirror", "historian", "alerts", "--config", str(tmp_path / "processors.toml"), "--broker", broker],
        ["edge", "run", str(tmp_path / "vmc.toml"), "--broker", broker],
        ["jobs", "run", "--dir", str(home / "jobs"), "--broker", broker],
        ["serve", "--no-open", "--port", "0", "--state-file", str(home / "serve.json"), "--broker", broker],
    )
    home.mkdir()
    home.chmod(0o755)
    running = [lax(*command, env=environment) for command in commands]
    wanted = ("state/twin-mirror.json", "edges/vmc.json", "jobs/twin-jobs.json", "serve.json", "store")
    try:
        until(lambda: all((home / name).exists() for name in wanted) or any(one.poll() is not None for one in running), "files")
        assert [one.communicate() for one in running if one.poll() is not None] == []
    finally:
        for process in running:
            end(process)
    found = modes(home)
    assert len(found) > 12
    assert {name: oct(mode) for name, mode in found.items() if mode & 0o077} == {}


@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o640), (0o000, 0o640), (0o077, 0o600)], ids=["lax", "none", "strict"])
def test_what_was_asked_for_a_group_may_read_and_nobody_else(umask: int, mode: int, tmp_path: Path) -> None:
    out, program = tmp_path / "run.csv", tmp_path / "line.nc"
    program.write_text("G1 X5 F1000\nM30\n")
    machine = Path("cnctwin/standins/simulated_machine/machine.toml").resolve()
    process = lax("simulate", str(program), "--machine", str(machine), "--out", str(out), umask=umask)
    said = process.communicate(timeout=300)
    assert process.returncode == 0, said
    assert oct(stat.S_IMODE(out.stat().st_mode)) == oct(mode)
