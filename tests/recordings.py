"""Where the recordings of real machines are: `CNCTWIN_DATA`, else `../shared/data` beside the project.

They are not part of the project. A test that needs one skips, saying which is missing and where it looked.
"""

import os
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parent.parent


def recordings_folder() -> Path:
    """The folder that holds `mtconnect/`, `nist/` and `emps/`."""
    named = os.environ.get("CNCTWIN_DATA")
    return Path(named) if named else PROJECT.parent / "shared" / "data"


def recording(name: str) -> Path:
    """Return the path of a recording such as `mtconnect/okuma.txt`; skip the test where it is missing."""
    path = recordings_folder() / name
    if not path.exists():
        pytest.skip(f"no recording {path}; CNCTWIN_DATA names the folder of the recordings")
    return path
