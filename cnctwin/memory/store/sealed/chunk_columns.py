"""Chunks as the columns that are sealed: those of messages that are alike are joined, and share what arrays they can."""

from collections.abc import Iterable, Sequence
from itertools import repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cnctwin.memory.store.chunk import KINDS, Chunk
from cnctwin.memory.store.intake import order_of
from cnctwin.memory.store.sealed.rows import HeaderOf, Ints, Part, Rows

_TYPES = {"d": "<f8", "q": "<i8", "?": "?"}
_Piece = tuple[Ints, Any, Ints, Ints]
"""Time in µs, values, flags and numbers of messages of one series."""


def columns_of(chunks: Iterable[Chunk]) -> Rows:
    """The samples of chunks by series, and their messages by number."""
    alike: dict[bytes, list[Chunk]] = {}
    for chunk in chunks:
        alike.setdefault(chunk.alike, []).append(chunk)
    pieces: dict[int, list[_Piece]] = {}
    kinds = {}
    headers: dict[int, HeaderOf] = {}
    for some in alike.values():
        numbers = np.concatenate([_array(c, "<u4", c.places[0]).astype(np.int64) + c.first for c in some])
        first = some[0]
        times = _times(some)
        _put_headers(headers, some, numbers, times)
        flags = {flag: np.full(len(numbers), flag, dtype=np.int64) for flag in set(first.flags)}
        for place, (sid, flag, letter) in enumerate(zip(first.sids, first.flags, first.letters, strict=True)):
            kinds[sid] = KINDS[letter]
            t = times[0 if first.is_single else place]
            pieces.setdefault(sid, []).append((t, _values(some, place, letter), flags[flag], numbers))
    join = _Joining()
    return Rows({sid: join.part(kinds[sid], some) for sid, some in pieces.items()}, headers)


class _Joining:
    """Joins the arrays of several kinds of messages; series that come in the same ones share what is joined."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, ...], Ints] = {}

    def part(self, kind: Any, pieces: Sequence[_Piece]) -> Part:
        t, values, flags, numbers = zip(*pieces, strict=True)
        forms = values[0] if len(values) == 1 else _joined(values)
        return Part(kind, self._array(t), forms, self._array(flags), self._array(numbers))

    def _array(self, arrays: Sequence[Ints]) -> Ints:
        if len(arrays) == 1:
            return arrays[0]
        key = tuple(map(id, arrays))
        if key not in self._known:
            self._known[key] = np.concatenate(arrays)
        return self._known[key]


def _joined(values: Sequence[Any]) -> Any:
    if isinstance(values[0], list):
        return [value for some in values for value in some]
    return np.concatenate(values)


def _array(chunk: Chunk, of: str, at: int) -> NDArray[Any]:
    return np.frombuffer(chunk.body, of, chunk.count, at)


def _times(some: Sequence[Chunk]) -> list[Ints]:
    """The times of the samples in µs, one array where all samples of a message have one time, else one a column."""
    columns = 1 if some[0].is_single else len(some[0].sids)
    return [
        np.concatenate([_array(c, "<i8", c.places[1] + 8 * c.count * column) for c in some]) * 1000 for column in range(columns)
    ]


def _values(some: Sequence[Chunk], place: int, letter: str) -> Any:
    if letter == "I":
        return [value for chunk in some for value in chunk.values(place)]
    return np.concatenate([_array(c, _TYPES[letter], c.places[2][place]) for c in some])


def _put_headers(headers: dict[int, HeaderOf], some: Sequence[Chunk], numbers: Ints, times: Sequence[Ints]) -> None:
    first = some[0]
    places: Iterable[bytes | None]
    if first.is_single:
        places = repeat(order_of([(0, sid) for sid in first.sids]))
    else:
        told = zip(*(t.tolist() for t in times), strict=True)
        places = (order_of(list(zip(t, first.sids, strict=True))) for t in told)
    received = [ms for chunk in some for ms in chunk.received_ms()]
    stamps = [ms for chunk in some for ms in chunk.message_stamps()]
    nodes = [node for chunk in some for node in repeat(chunk.node, chunk.count)]
    told = zip(received, stamps, nodes, repeat(True), places, strict=False)  # what is the same for all has no end
    headers.update(zip(numbers.tolist(), map(HeaderOf._make, told), strict=True))
