"""Finding the dialect of a file by its beginning. Nothing is registered by being imported."""

import importlib
import pkgutil
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from functools import cache
from pathlib import Path

from cnctwin.errors import UsageError
from cnctwin.importing import dialects
from cnctwin.importing.dialects.contract import HEAD_BYTES, Dialect, Head

_MARKS = ((BOM_UTF8, "utf-8-sig"), (BOM_UTF16_LE, "utf-16"), (BOM_UTF16_BE, "utf-16"))


@cache
def discover() -> tuple[Dialect, ...]:
    """Return all dialects, those that are sure of themselves first."""
    found = []
    for module in sorted(pkgutil.iter_modules(dialects.__path__), key=lambda m: m.name):
        declared = getattr(importlib.import_module(f"{dialects.__name__}.{module.name}"), "DIALECT", None)
        if isinstance(declared, Dialect):
            found.append(declared)
    return tuple(sorted(found, key=lambda one: one.is_fallback))


def read_head(path: Path, encoding: str | None = None) -> Head:
    """Read the beginning of a file. Raises UsageError where there is none."""
    try:
        with path.open("rb") as file:
            raw = file.read(HEAD_BYTES)
        size = path.stat().st_size
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror or error}") from None
    if not raw:
        raise UsageError(f"{path}: is empty")
    named = encoding or next((name for mark, name in _MARKS if raw.startswith(mark)), None) or _guessed(raw)
    try:
        text = raw.decode(named, "replace")
    except LookupError:
        raise UsageError(f"encoding = {named!r} is not known; name one such as utf-8, utf-16, latin-1 or cp1252") from None
    return Head(raw, text.removeprefix("\ufeff"), named, size)


def _guessed(raw: bytes) -> str:
    """Return the encoding of text without a byte order mark; what is no UTF-8 is read as Windows writes it."""
    if raw[1:400:2].count(0) > len(raw[1:400:2]) * 0.8:
        return "utf-16-le"
    if raw[0:400:2].count(0) > len(raw[0:400:2]) * 0.8:
        return "utf-16-be"
    try:
        raw.decode("utf-8")
    except UnicodeDecodeError as error:
        if len(raw) < HEAD_BYTES or error.start < len(raw) - 3:  # else it is a character that the head's end cuts
            return "latin-1"
    return "utf-8"


def dialect_of(path: Path, head: Head) -> Dialect:
    """Return the dialect of a file. Raises UsageError where there is none."""
    for dialect in discover():
        if dialect.recognises(head):
            return dialect
    known = ", ".join(dialect.name for dialect in discover())
    raise UsageError(f"{path}: is none of the files that can be read ({known}); export it as text with one line of names")
