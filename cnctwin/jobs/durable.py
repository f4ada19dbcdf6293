"""Files that are there as a whole or not at all, also after a power cut."""

import json
import os
from pathlib import Path
from typing import Any

from cnctwin.files.synced import sync

EXIT_DISK = 74
"""Exit code of a process that could not write what it has to say."""


def write_json(path: Path, document: Any, *, durable: bool = True) -> None:
    """Replace a file. durable: it is on the disk when this returns, else only whole. Raises OSError, and the old one stays."""
    beside = path.with_name(f".{path.name}.new")
    try:
        with beside.open("w", encoding="utf-8") as out:
            json.dump(document, out)
            out.flush()
            if durable:
                os.fsync(out.fileno())
        beside.replace(path)
    except OSError:
        beside.unlink(missing_ok=True)
        raise
    if durable:
        sync(path.parent)


def read_json(path: Path, bytes_max: int = 1_000_000) -> dict[str, Any] | None:
    """The object in a file; None where there is none that can be read."""
    try:
        with path.open("rb") as source:
            document = json.loads(source.read(bytes_max))
    except (OSError, ValueError, RecursionError):
        return None
    return document if isinstance(document, dict) else None
