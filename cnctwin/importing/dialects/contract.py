"""A dialect: a kind of file that a recording comes in. It tells the columns and gives their values in pieces; it judges nothing.

A new kind of file is one file in this folder that ends in `DIALECT = Dialect(...)`, and a sample of its own in
`tests/cnctwin/importing/dialects/samples/`, named as the module, with which the contract suite there tries it.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa

from cnctwin.importing.column_map import FileOptions

HEAD_BYTES = 256 * 1024


@dataclass(frozen=True, slots=True)
class Head:
    """The beginning of a file, by which its dialect is recognised. text: decoded as far as can be, without a byte order mark."""

    raw: bytes
    text: str
    encoding: str
    size: int


class SourceColumn(NamedTuple):
    """A column of the file. unit: as the file states it, "" where it doesn't; track: the columns that share times with it."""

    name: str
    unit: str = ""
    description: str = ""
    track: int = 0


class Times(NamedTuple):
    """The times of a track: a column, a steady rate, or unknown (both None)."""

    column: str | None = None
    unit: str = ""
    period_s: float | None = None


class Piece(NamedTuple):
    """The next rows of one track: column → values, all of one length. Texts are as they stand in the file."""

    track: int
    values: Mapping[str, pa.Array]


@dataclass(slots=True)
class Faults:
    """The count of what a dialect met and left out: what it was → how often. Filled while the pieces are read."""

    counts: dict[str, int] = field(default_factory=dict)

    def count(self, what: str, by: int = 1) -> None:
        """Count what was left out."""
        if by:
            self.counts[what] = self.counts.get(what, 0) + by


@dataclass(frozen=True, slots=True)
class Content:
    """A file that is open for reading.

    tracks: by number; decimal: of texts that are numbers; start_ns: time of t = 0 since 1970,
    where the file states it
    """

    columns: tuple[SourceColumn, ...]
    tracks: tuple[Times, ...]
    pieces: Callable[[], Iterator[Piece]]
    faults: Faults
    decimal: str = "."
    start_ns: int | None = None


@dataclass(frozen=True, slots=True)
class Dialect:
    """One kind of file.

    name: as a sentence names it; recognises: by the file's head; reads: the path, its head and the options of the map;
    is_fallback: only asked where no other recognises the file; units: of what its columns mean, where files don't state it
    """

    name: str
    recognises: Callable[[Head], bool]
    reads: Callable[[Path, Head, FileOptions], Content]
    is_fallback: bool = False
    units: Mapping[str, str] = field(default_factory=dict)
