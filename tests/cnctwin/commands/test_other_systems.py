"""The client's commands on systems that are no Linux: they load without its modules, and print to a terminal without UTF-8.

No Windows and no macOS is at hand: this takes away what Windows lacks, and shows that nothing asks for it.
"""

import os
import subprocess
import sys

import pytest

WITHOUT_LINUX = """
import sys
# The standard library as it is here, before what Windows lacks is taken away.
import asyncio, concurrent.futures, getpass, multiprocessing, selectors, socket, ssl, subprocess, tempfile, zipfile
import numpy, scipy, numba, pyarrow, rich.console, typer, paho.mqtt.client
import os

GONE = {"fcntl", "resource", "pwd", "grp", "termios", "pty", "tty", "syslog", "spwd", "crypt"}
for name in GONE:
    sys.modules.pop(name, None)
for name in ("getuid", "geteuid", "getgid", "fork", "fchmod", "setsid", "killpg", "O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC"):
    vars(os).pop(name, None)

class Gone:
    def find_spec(self, name, path=None, target=None):
        if name in GONE:
            raise ModuleNotFoundError(f"no module {name} on Windows", name=name)

sys.meta_path.insert(0, Gone())
import importlib
for name in sys.argv[1:]:
    importlib.import_module(name)
print("loaded")
"""

CLIENT = {
    "simulate": ("cnctwin.commands.twin.simulate", "cnctwin.batch.simulation", "twin.simulator.simulation", "twin.runlog"),
    "gap diagnose": ("cnctwin.commands.twin.gap", "cnctwin.batch.diagnosis", "cnctwin.reports.gap", "twin.case"),
    "optimise": ("cnctwin.commands.twin.optimise", "cnctwin.batch.optimisation", "twin.optimisation.question"),
    "identify": ("cnctwin.commands.twin.identify", "cnctwin.batch.identification"),
    "expect": ("cnctwin.commands.twin.expect", "twin.expected.making"),
    "watch": ("cnctwin.commands.see.watch", "cnctwin.plant.watch"),
    "doctor": ("cnctwin.commands.see.doctor", "cnctwin.plant.doctor", "cnctwin.plant.bundle"),
}


@pytest.mark.parametrize("modules", CLIENT.values(), ids=CLIENT.keys())
def test_a_command_of_the_client_asks_for_nothing_of_linux(modules: tuple[str, ...]) -> None:
    command = [sys.executable, "-c", WITHOUT_LINUX, "cnctwin.cli", *modules]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert (done.stdout.strip(), done.stderr) == ("loaded", "")


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "cp437"])
def test_a_terminal_without_utf_8_gets_question_marks_and_no_traceback(encoding: str) -> None:
    code = "import sys; sys.argv[1:] = ['store', 'plan', '--machines', '1']; from cnctwin.cli import main; main()"
    environment = os.environ | {"PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    sign = "import cnctwin.commands.keep.store as s; s._show_plan = lambda *_: print('2 µm → 1 µm'); "
    done = subprocess.run([sys.executable, "-c", sign + code], capture_output=True, check=False, timeout=60, env=environment)
    assert b"Traceback" not in done.stderr
    assert done.stdout.decode(encoding).strip() == {"ascii": "2 ?m ? 1 ?m"}.get(encoding, "2 µm ? 1 µm")
