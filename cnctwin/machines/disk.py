"""Writes that a power cut leaves done or not done: each is forced to the disk before it returns."""

import json
import os
from pathlib import Path
from typing import Any

from cnctwin.errors import ApplicationError
from cnctwin.files.modes import PRODUCT_FILE
from cnctwin.files.synced import make_folder, sync


class FolderError(ApplicationError):
    """A folder of descriptions that cannot be read or written."""


def put(path: Path, text: str) -> None:
    """Replace a file as a whole; it keeps its mode. Raises FolderError, and the old one stays."""
    beside = path.with_name(f".{path.name}.new")
    try:
        make_folder(path.parent)
        with beside.open("w", encoding="utf-8", newline="\n") as out:
            out.write(text)
            out.flush()
            os.fsync(out.fileno())
        beside.chmod(path.stat().st_mode & 0o777 if path.exists() else PRODUCT_FILE)
        beside.replace(path)
        sync(path.parent)
    except OSError as error:
        raise FolderError(f"{path}: cannot be written: {error.strerror or error}; nothing was changed") from None


def remove(path: Path) -> None:
    """Remove a file, if it is there. Raises FolderError."""
    try:
        path.unlink(missing_ok=True)
        sync(path.parent)
    except OSError as error:
        raise FolderError(f"{path}: cannot be removed: {error.strerror or error}") from None


def append(path: Path, line: str) -> None:
    """Add a line to a file; half a line that a power cut has left stays one of its own. Raises FolderError."""
    try:
        make_folder(path.parent)
        with path.open("ab+") as out:
            size = out.seek(0, os.SEEK_END)
            is_cut = size > 0 and _last(out.fileno(), size) != b"\n"
            out.write((b"\n" if is_cut else b"") + line.encode() + b"\n")
            out.flush()
            os.fsync(out.fileno())
        if not size:
            path.chmod(PRODUCT_FILE)
            sync(path.parent)
    except OSError as error:
        raise FolderError(f"{path}: cannot be written: {error.strerror or error}") from None


def text_of(path: Path) -> str | None:
    """Return the text of a file; None where there is none. Raises FolderError where it cannot be read."""
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        raise FolderError(f"{path}: cannot be read: {error}") from None


def json_of(path: Path) -> dict[str, Any] | None:
    """Return the object in a file; None where there is none that can be read."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    return document if isinstance(document, dict) else None


def _last(descriptor: int, size: int) -> bytes:
    return os.pread(descriptor, 1, size - 1)
