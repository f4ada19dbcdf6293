"""`scripts/setup` takes a Python that the lock serves, and says so where there is none."""

import os
import subprocess
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
