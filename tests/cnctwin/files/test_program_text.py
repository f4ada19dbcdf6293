"""Texts that a person names: read within a bound, which is looked at before the file is."""

from pathlib import Path

import pytest

from cnctwin.errors import UsageError
from cnctwin.files.program_text import BYTES_MAX, read_text


def test_a_file_beyond_the_bound_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "endless.nc"
    with path.open("wb") as file:
        file.truncate(BYTES_MAX + 1)  # a hole: it takes no room on the disk
    with pytest.raises(UsageError, match=f"has {BYTES_MAX + 1} bytes; {BYTES_MAX} are read: cut it into parts"):
        read_text(path)
    path.write_bytes(b"G1 X1 (\xd8)\n")
    assert read_text(path) == "G1 X1 (Ø)\n"
