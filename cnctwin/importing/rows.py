"""The rows of one file, in order of time: the tracks merged, what repeats a time or goes back left out and counted.

Nothing is put between samples: where a track has none at a time of another, there is no value.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from cnctwin.errors import UsageError
from cnctwin.importing.dialects.contract import Content, Piece
from cnctwin.importing.stamps import NS, UNREADABLE, Stamps, stamps
from cnctwin.importing.values import Reader, Tally, Values

REPEATED = "rows that repeat the time of the row before"
BACKWARD = "rows whose time goes back (a clock that was set?)"
PENDING_MAX = 50_000_000


class Block(NamedTuple):
    """Rows in order of time. t_ns: (n,), increasing; columns: name → (n,)."""

    t_ns: NDArray[np.int64]
    columns: Mapping[str, Values]
    is_absolute: bool


class Clock(NamedTuple):
    """The times of a track: a column with unit or format, or a period."""

    column: str | None
    unit: str = "s"
    form: str | None = None
    period_s: float | None = None


@dataclass(slots=True)
class Reading:
    """The yield of a file: its content, what is taken of it, and the count of what was met. rows: of all tracks, as read."""

    content: Content
    clocks: Sequence[Clock]
    readers: Mapping[str, Reader]
    tallies: dict[str, Tally] = field(default_factory=dict)
    time_tally: Tally = field(default_factory=Tally)
    rows: int = 0
    counts: dict[str, int] = field(default_factory=dict)

    def count(self, what: str, by: int) -> None:
        """Count rows that were left out."""
        if by:
            self.counts[what] = self.counts.get(what, 0) + by

    def faults(self) -> dict[str, int]:
        """Return what was left out, from the file and from its rows."""
        return {**self.content.faults.counts, **self.counts}


def blocks(reading: Reading) -> Iterator[Block]:
    """Yield the rows of a file in order of time."""
    taken = {
        name: reading.content.columns[_at(reading.content, reader.options.source)].track
        for name, reader in reading.readers.items()
    }
    tracks = sorted({*taken.values()})
    lasts = dict.fromkeys(tracks, np.iinfo(np.int64).min)
    numbers = dict.fromkeys(tracks, 0)
    pending: dict[int, list[Block]] = {track: [] for track in tracks}
    for piece in reading.content.pieces():
        if piece.track not in pending:
            continue
        block = _block(reading, piece, [name for name in taken if taken[name] == piece.track], lasts, numbers)
        if not len(block.t_ns):
            continue
        if len(tracks) == 1:
            yield block
            continue
        pending[piece.track].append(block)
        if sum(len(one.t_ns) for some in pending.values() for one in some) > PENDING_MAX:
            raise UsageError(
                f"one group of channels is more than {PENDING_MAX} rows ahead of another; export them in shorter pieces"
            )
        yield from _merged(pending, min(lasts.values()))
    if len(tracks) > 1:
        yield from _merged(pending, np.iinfo(np.int64).max)


def _at(content: Content, name: str) -> int:
    return next(n for n, column in enumerate(content.columns) if column.name == name)


def _block(reading: Reading, piece: Piece, names: Sequence[str], lasts: dict[int, int], numbers: dict[int, int]) -> Block:
    """Read a piece of a track; `lasts` and `numbers`, its last time and its count of rows, go on."""
    found = _stamps(reading, piece, numbers)
    usable = np.flatnonzero(found.known)
    t_ns = found.t_ns[usable]
    before = np.maximum.accumulate(np.concatenate([[lasts[piece.track]], t_ns]))[:-1]
    reading.count(REPEATED, int((t_ns == before).sum()))
    reading.count(BACKWARD, int((t_ns < before).sum()))
    kept = t_ns > before
    usable, t_ns = usable[kept], t_ns[kept]
    if len(t_ns):
        lasts[piece.track] = int(t_ns[-1])
    columns: dict[str, Values] = {}
    for name in names:
        reader = reading.readers[name]
        told = piece.values[reader.options.source]
        told = told if len(usable) == len(told) else told.take(usable)
        columns[name] = reader.read(told, reading.tallies.setdefault(name, Tally()))
    return Block(t_ns, columns, found.is_absolute)


def _stamps(reading: Reading, piece: Piece, numbers: dict[int, int]) -> Stamps:
    """Return the times of a piece, and count those that cannot be read."""
    clock, content = reading.clocks[piece.track], reading.content
    rows = len(next(iter(piece.values.values())))
    reading.rows += rows
    if clock.column is None:
        assert clock.period_s is not None
        index = np.arange(numbers[piece.track], numbers[piece.track] + rows, dtype=np.float64)
        numbers[piece.track] += rows
        found = Stamps(np.round(index * clock.period_s * NS).astype(np.int64), np.ones(rows, dtype=bool), False)
    else:
        told = piece.values[clock.column]
        found = stamps(told, clock.unit, clock.form, content.decimal, reading.time_tally)
        if not found.known.all():
            # Of several tracks one that has ended leaves its times empty; that is no fault.
            blank = sum(value is None or not str(value).strip() for value in told.filter(pa.array(~found.known)).to_pylist())
            unreadable = int((~found.known).sum())
            reading.count(UNREADABLE, unreadable if len(content.tracks) == 1 else unreadable - blank)
    if not found.is_absolute and content.start_ns is not None:
        return Stamps(found.t_ns + content.start_ns, found.known, True)
    return found


def _merged(pending: dict[int, list[Block]], until_ns: int) -> Iterator[Block]:
    """Yield what all tracks have up to a time, in one block; the rest stays pending."""
    ready: list[Block] = []
    for track, waiting in pending.items():
        left: list[Block] = []
        for block in waiting:
            cut = int(np.searchsorted(block.t_ns, until_ns, side="right"))
            if cut:
                ready.append(Block(block.t_ns[:cut], {n: v[:cut] for n, v in block.columns.items()}, block.is_absolute))
            if cut < len(block.t_ns):
                left.append(Block(block.t_ns[cut:], {n: v[cut:] for n, v in block.columns.items()}, block.is_absolute))
        pending[track] = left
    if not ready:
        return
    t_ns = np.unique(np.concatenate([block.t_ns for block in ready]))
    columns: dict[str, Values] = {}
    for block in ready:
        at = np.searchsorted(t_ns, block.t_ns)
        for name, values in block.columns.items():
            if name not in columns:
                columns[name] = empty(len(t_ns), is_text=values.dtype == object)
            columns[name][at] = values
    yield Block(t_ns, columns, ready[0].is_absolute)


def empty(rows: int, *, is_text: bool) -> Values:
    """Return a column without a value."""
    return np.full(rows, None, dtype=object) if is_text else np.full(rows, np.nan)
