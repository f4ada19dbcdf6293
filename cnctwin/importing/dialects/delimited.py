"""Any text table: CSV, TSV, and what oscilloscopes export as text (SERVO GUIDE, TNCscope). Read in blocks, whatever its size."""

import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import pyarrow as pa
from pyarrow import csv

from cnctwin.errors import UsageError
from cnctwin.importing.column_map import FileOptions
from cnctwin.importing.dialects.contract import Content, Dialect, Faults, Head, Piece, Times
from cnctwin.importing.dialects.layout import Layout, layout

BLOCK_BYTES = 4 * 1024 * 1024
OTHER_LENGTH = "lines with another number of fields than the table (cut off, or a remark)"
_SPACES = re.compile(rb"(?m)^[ \t]+|[ \t]+$")
_INNER = re.compile(rb"[ \t]+")


def text_rows(path: Path, encoding: str, found: Layout, faults: Faults) -> Iterator[dict[str, pa.Array]]:
    """Yield the rows of a text table in blocks: column → texts as they stand in the file. Raises UsageError."""
    names = [column.name for column in found.columns]

    def skipped(_row: Any) -> str:
        faults.count(OTHER_LENGTH)
        return "skip"

    convert = csv.ConvertOptions(column_types=dict.fromkeys(names, pa.string()), strings_can_be_null=False, check_utf8=True)
    parse = csv.ParseOptions(delimiter=found.separator, invalid_row_handler=skipped)
    read = csv.ReadOptions(
        column_names=names, skip_rows=found.data_line, encoding=encoding, block_size=BLOCK_BYTES, use_threads=False
    )
    try:
        with _opened(path, found.separator) as file, csv.open_csv(file, read, parse, convert) as reader:
            for batch in reader:
                yield dict(zip(names, batch.columns, strict=True))
    except (pa.ArrowException, UnicodeError, OSError) as error:
        first = (str(error).splitlines() or [type(error).__name__])[0]
        raise UsageError(f"{path}: cannot be read as a table in {encoding}: {first}; name its encoding in [options]") from None


class _OneSpace(io.RawIOBase):
    """A file whose runs of spaces are one each, and whose lines begin and end without."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._file = path.open("rb")
        self._rest = b""

    def readable(self) -> bool:
        return True

    def read(self, size: int = -1) -> bytes:
        while len(self._rest) < max(size, 1):
            block = self._file.read(BLOCK_BYTES)
            block += self._file.readline()
            if not block:
                break
            self._rest += _INNER.sub(b" ", _SPACES.sub(b"", block.replace(b"\r\n", b"\n")))
        taken, self._rest = (self._rest, b"") if size < 0 else (self._rest[:size], self._rest[size:])
        return taken

    def close(self) -> None:
        self._file.close()
        super().close()


def _opened(path: Path, separator: str) -> Any:
    return pa.PythonFile(cast("Any", _OneSpace(path)), mode="r") if separator == " " else path.open("rb")


def content(path: Path, encoding: str, found: Layout, times: Times = Times()) -> Content:  # noqa: B008  a frozen value
    """Return a text table as a file's content, all columns in one track."""
    faults = Faults()

    def pieces() -> Iterator[Piece]:
        return (Piece(0, block) for block in text_rows(path, encoding, found, faults))

    return Content(found.columns, (times,), pieces, faults, found.decimal)


def is_text(head: Head) -> bool:
    """Return True for text that is no XML; whether rows of numbers are in it is found when it is read."""
    sample = head.text[:4000]
    odd = sum(not (character.isprintable() or character in "\t\r\n") for character in sample)
    return "\x00" not in head.text and odd * 20 < len(sample) and not head.text.lstrip().startswith("<")


def _reads(path: Path, head: Head, options: FileOptions) -> Content:
    found = layout(head, options)
    if found is None:
        raise UsageError(
            f"{path}: no rows of numbers are found in it; name separator, names_line and data_line in [options] of --map"
        )
    return content(path, options.encoding or head.encoding, found)


DIALECT = Dialect(
    name="text table",
    recognises=is_text,
    reads=_reads,
    is_fallback=True,
)
