"""A chunk: messages of one machine and node that are alike, within a minute, as columns in one row of SQLite.

Alike are messages that say the same signals in the same order, with the same units, qualities and reasons, and values of the same
kinds; all that differs are numbers, times and values. Little-endian:

    is_single u8 | columns u16 | messages u32
    series u32 × columns | flag u32 × columns | letter u8 × columns
    number − first number u32 × messages | received ms i64 × messages | stamp of the message ms i64 × messages
    stamps of the samples ms i64 × messages (is_single: all samples of a message have one; else column by column)
    values, column by column: `d` double, `q` i64, `?` bool, `I` place of a text
    texts as UTF-8, each behind its length u32
"""

import sqlite3
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import chain, islice
from operator import gt
from struct import Struct, pack, unpack_from
from typing import Any, NamedTuple

from cnctwin.memory.store.value_form import Kind

LETTERS = {float: "d", int: "q", bool: "?", str: "I"}
"""The types of values that a chunk holds."""
KINDS = {"d": Kind.FLOAT, "q": Kind.INT, "?": Kind.BOOL, "I": Kind.TEXT}
CHUNK_MS = 60_000
"""A chunk holds samples of one such stretch, counted from 1970."""
_HEAD = Struct("<BHI")
_SIZES = {"d": 8, "q": 8, "?": 1, "I": 4}
_CHUNK = "SELECT chunks.number, chunks.class, nodes.name, body FROM chunks {} JOIN nodes ON nodes.id = chunks.node WHERE"
_OF_MINUTES = f"{_CHUNK.format('INDEXED BY chunks_of_machine')} machine = ? AND minute >= ? AND minute < ?"
_OF_NUMBERS = f"""{_CHUNK.format("")} number IN
    (SELECT number FROM chunks INDEXED BY chunks_of_machine WHERE machine = ? AND number < ? AND last_number >= ?)"""  # noqa: S608


class Form(NamedTuple):
    """The form of a body up to its texts, and where in it things are."""

    struct: Struct
    offsets: int
    received: int
    stamps: int
    sample_stamps: int
    values: tuple[int, ...]


@lru_cache(maxsize=4096)
def form_of(letters: str, count: int, *, is_single: bool) -> Form:
    """The form of `count` messages with columns of these letters."""
    m, n = len(letters), count
    stamps = n if is_single else m * n
    offsets = _HEAD.size + 9 * m
    received, at = offsets + 4 * n, offsets + 20 * n + 8 * stamps
    values = []
    for letter in letters:
        values.append(at)
        at += n * _SIZES[letter]
    columns = "".join(f"{n}{letter}" for letter in letters)
    struct = Struct(f"<BHI{2 * m}I{m}s{n}I{n}q{n}q{stamps}q{columns}")
    return Form(struct, offsets, received, received + 8 * n, received + 16 * n, tuple(values))


class Alike(NamedTuple):
    """The form that the messages of a chunk share: for each column the letter of its type, its series and flag."""

    letters: str
    sids: Sequence[int]
    flags: Sequence[int]
    is_single: bool


def packed(
    alike: Alike,
    messages: Sequence[tuple[int, int, int]],
    stamps: Iterable[int],
    rows: Sequence[Sequence[Any]],
    texts: Iterable[str],
) -> bytes:
    """The body of a chunk.

    messages: number behind the first, received_ms, stamp_ms of each; stamps: of the samples, as the body has them; rows: of each
    message its values, a text as its place in `texts`
    """
    form = form_of(alike.letters, len(rows), is_single=alike.is_single)
    head = (alike.is_single, len(alike.letters), len(rows), *alike.sids, *alike.flags, alike.letters.encode())
    columns = chain.from_iterable(zip(*rows, strict=True))
    body = form.struct.pack(*head, *chain.from_iterable(zip(*messages, strict=True)), *stamps, *columns)
    return body + b"".join(pack("<I", len(text)) + text for text in (text.encode() for text in texts))


class Chunk:
    """A chunk, read: what is asked of it is unpacked."""

    __slots__ = ("_form", "_texts", "body", "count", "first", "flags", "is_single", "letters", "node", "sids", "stored_class")

    def __init__(self, first: int, stored_class: int, node: str, body: bytes) -> None:
        self.first, self.stored_class, self.node, self.body = first, stored_class, node, body
        is_single, columns, self.count = _HEAD.unpack_from(body)
        self.is_single = bool(is_single)
        self.sids: tuple[int, ...] = unpack_from(f"<{columns}I", body, _HEAD.size)
        self.flags: tuple[int, ...] = unpack_from(f"<{columns}I", body, _HEAD.size + 4 * columns)
        self.letters = body[_HEAD.size + 8 * columns : _HEAD.size + 9 * columns].decode()
        self._form = form_of(self.letters, self.count, is_single=self.is_single)
        self._texts: list[str] | None = None

    @property
    def alike(self) -> bytes:
        """The bytes that all chunks of such messages share, apart from the number of messages."""
        return self.body[:3] + self.body[_HEAD.size : self._form.offsets]

    def numbers(self) -> list[int]:
        """The numbers of the messages."""
        return [self.first + offset for offset in unpack_from(f"<{self.count}I", self.body, self._form.offsets)]

    def received_ms(self) -> tuple[int, ...]:
        """Return the times at which the messages were received, ms."""
        return unpack_from(f"<{self.count}q", self.body, self._form.received)

    def message_stamps(self) -> tuple[int, ...]:
        """The messages' own stamps, ms."""
        return unpack_from(f"<{self.count}q", self.body, self._form.stamps)

    def stamps(self, place: int) -> tuple[int, ...]:
        """The stamps of a column's samples, ms."""
        skipped = 0 if self.is_single else 8 * self.count * place
        return unpack_from(f"<{self.count}q", self.body, self._form.sample_stamps + skipped)

    def values(self, place: int) -> Sequence[Any]:
        """The values of a column."""
        letter = self.letters[place]
        values = unpack_from(f"<{self.count}{letter}", self.body, self._form.values[place])
        if letter != "I":
            return values
        texts = self.texts
        return [texts[value] for value in values]

    @property
    def places(self) -> tuple[int, int, tuple[int, ...]]:
        """The offsets in the body of the numbers, of the stamps of samples, and of each column."""
        return self._form.offsets, self._form.sample_stamps, self._form.values

    @property
    def texts(self) -> list[str]:
        """The texts that the columns of letter `I` name by place."""
        if self._texts is None:
            self._texts, at = [], self._form.struct.size
            while at < len(self.body):
                (size,) = unpack_from("<I", self.body, at)
                self._texts.append(self.body[at + 4 : at + 4 + size].decode())
                at += 4 + size
        return self._texts


def read_chunks(db: sqlite3.Connection, machine: int, from_ms: int, to_ms: int) -> list[Chunk]:
    """The chunks of a machine that may hold samples of [from_ms, to_ms), in the order of their first messages."""
    rows = db.execute(_OF_MINUTES, (machine, from_ms // CHUNK_MS, -(-to_ms // CHUNK_MS))).fetchall()
    return [Chunk(*row) for row in sorted(rows)]


def read_chunks_of_page(db: sqlite3.Connection, machine: int, first: int, until: int) -> list[Chunk]:
    """The chunks of a machine that may hold messages with numbers in [first, until)."""
    return [Chunk(*row) for row in db.execute(_OF_NUMBERS, (machine, until, first))]


class ChunkColumn(NamedTuple):
    """The samples of a series in the order of time: stamps in ms, values, flags."""

    stamps: list[int]
    values: list[Any]
    flags: list[int]


class ChunkSamples:
    """The samples that chunks of one machine hold, by series."""

    def __init__(self, some: Iterable[Chunk]) -> None:
        self._of: dict[int, list[tuple[Chunk, int]]] = {}
        self._columns: dict[int, ChunkColumn] = {}
        for chunk in some:
            for place, sid in enumerate(chunk.sids):
                self._of.setdefault(sid, []).append((chunk, place))

    def column(self, sid: int) -> ChunkColumn:
        """The samples of a series."""
        if sid not in self._columns:
            self._columns[sid] = self._column(sid)
        return self._columns[sid]

    def _column(self, sid: int) -> ChunkColumn:
        stamps: list[int] = []
        values: list[Any] = []
        flags: list[int] = []
        for chunk, place in self._of.get(sid, ()):
            stamps += chunk.stamps(place)
            values += chunk.values(place)
            flags += [chunk.flags[place]] * chunk.count
        if any(map(gt, stamps, islice(stamps, 1, None))):  # kinds of messages that take turns
            order = sorted(range(len(stamps)), key=stamps.__getitem__)
            return ChunkColumn([stamps[i] for i in order], [values[i] for i in order], [flags[i] for i in order])
        return ChunkColumn(stamps, values, flags)

    def within(self, sid: int, from_us: int, to_us: int) -> list[tuple[int, Any, int]]:
        """Time in µs, value and flag of the samples of a series in [from_us, to_us)."""
        stamps, values, flags = self.column(sid)
        some = slice(bisect_left(stamps, -(-from_us // 1000)), bisect_left(stamps, -(-to_us // 1000)))
        return list(zip([ms * 1000 for ms in stamps[some]], values[some], flags[some], strict=True))
