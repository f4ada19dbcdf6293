"""Files that a person asked for: written, or refused in one line."""

from collections.abc import Callable
from pathlib import Path

from cnctwin.errors import UsageError


def check_suffix(out: Path | None) -> None:
    """Raises UsageError where a run log would be written into a file of another kind."""
    if out is not None and out.suffix not in (".parquet", ".csv"):
        raise UsageError(f"{out}: a run log is written as .parquet or .csv, by the ending of its name")


def write(write: Callable[[], object], path: Path) -> None:
    """Call `write`, which writes `path`. Raises UsageError where that cannot be done."""
    try:
        write()
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror or error}") from None
