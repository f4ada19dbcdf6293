"""The text of a part program, and the encoding in which it goes back to the control byte for byte."""

from codecs import BOM_UTF8
from pathlib import Path

from cnctwin.errors import UsageError

BYTES_MAX = 128 * 1024 * 1024


def decoded(raw: bytes) -> tuple[str, str]:
    """Text and encoding; what is not UTF-8 is Latin-1, as controls write it.

    >>> decoded(b"(\\xd8 6)"), decoded(b"\\xef\\xbb\\xbfG0")
    (('(Ø 6)', 'latin-1'), ('G0', 'utf-8-sig'))
    """
    encoding = "utf-8-sig" if raw.startswith(BOM_UTF8) else "utf-8"
    try:
        return raw.decode(encoding), encoding
    except UnicodeDecodeError:
        return raw.decode("latin-1"), "latin-1"


def read_text(path: Path) -> str:
    """The text of a file that the user named; what is not UTF-8 is read as Latin-1, as controls write it. Raises UsageError."""
    return read_encoded(path)[0]


def read_encoded(path: Path) -> tuple[str, str]:
    """The text of a file, and the encoding in which it is written again byte for byte. Raises UsageError."""
    try:
        if path.is_file() and (size := path.stat().st_size) > BYTES_MAX:
            raise UsageError(f"{path}: has {size} bytes; {BYTES_MAX} are read: cut it into parts")
        raw = path.read_bytes()
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    return decoded(raw)
