"""The scripts explain themselves without doing anything; `scripts/setup` takes a Python that the lock serves."""

import os
import subprocess
from itertools import takewhile
from pathlib import Path

import pytest

SETUP = Path(__file__).parent.parent / "scripts" / "setup"


@pytest.mark.parametrize("version", ["(3, 10)", "(3, 14)"])
def test_a_python_that_the_lock_does_not_serve_is_refused_before_anything_is_installed(tmp_path: Path, version: str) -> None:
    """The stand-in answers as that version does."""
    python = tmp_path / "python"
    python.write_text(f'#!/bin/sh\nexec python3 -c "import sys; sys.version_info = {version}; $(printf "%s" "$2")"\n')
    python.chmod(0o755)
    environment = os.environ | {"CNCTWIN_PYTHON": str(python)}
    done = subprocess.run([SETUP], capture_output=True, text=True, check=False, timeout=60, env=environment)
    assert (done.returncode, done.stderr) == (2, f"setup: CNCTWIN_PYTHON={python} is no Python 3.11 to 3.13\n")


@pytest.mark.parametrize("name", ["demo", "docs", "kill-run", "lock", "peers", "picture", "screenshots", "setup", "test"])
def test_the_help_of_a_script_installs_and_starts_nothing(tmp_path: Path, name: str) -> None:
    """The copy has no project around it, so that installing or starting anything fails."""
    script = tmp_path / "scripts" / name
    script.parent.mkdir()
    script.write_text(SETUP.with_name(name).read_text(encoding="utf-8"), encoding="utf-8")
    script.chmod(0o755)
    done = subprocess.run([script, "--help"], capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    comment = takewhile(lambda line: line.startswith("# "), script.read_text(encoding="utf-8").splitlines()[1:])
    assert done.stdout.startswith("".join(f"{line[2:]}\n" for line in comment))
    assert sorted(tmp_path.rglob("*")) == [script.parent, script]


@pytest.mark.parametrize("name", ["screenshots", "setup"])
def test_an_argument_that_a_script_does_not_know_is_refused_in_a_line(name: str) -> None:
    done = subprocess.run([SETUP.with_name(name), "nonsense"], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 2
    assert "'nonsense'" in done.stderr and len(done.stderr.splitlines()) == 1
