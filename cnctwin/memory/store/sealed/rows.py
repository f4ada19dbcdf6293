"""Samples as the rows of a Parquet file: wide, one row for each message, time and quality, a column for each series.

columns: `n` number of the message, `t` ms and `sub` µs of the samples' time, `received` ms, `lag` = the message's own stamp minus
t, `node`, `data` (false: of a birth or death, whose readings are kept whole elsewhere), `quality` (0 good, 1 stale, 2 bad),
`history`, `reason`, `place` (the order of the readings within the message where it is not that of time and series), `nulls` (the
series that are null here), and `s<series><ending>` (`sealed_column`). All of these but n, t, received and the values cost nearly
nothing.
"""

import json
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from cnctwin.memory.store.sealed.column import forms_of, sealed_column
from cnctwin.memory.store.series_table import HISTORY_BIT, RANK_MASK, REASON_SHIFT
from cnctwin.memory.store.value_form import Kind

ROW_GROUP_ROWS = 16_384
METADATA = b"cnctwin"
_INTS = ("n", "t", "sub", "received", "lag")
_TEXTS = ("node", "reason", "place")
Ints = NDArray[np.int64]


class Part(NamedTuple):
    """The samples of one series: time in µs, value as SQLite has it, flag, number of the message."""

    kind: Kind
    t: Ints
    forms: list[Any]
    flags: Ints
    numbers: Ints


class HeaderOf(NamedTuple):
    """The part of a message that is kept with its samples."""

    received_ms: int
    stamp_ms: int
    node: str
    is_data: bool
    place: bytes | None


class Made(NamedTuple):
    """A file's bytes and what the manifest says of it: endings by series, series with nulls, whether anything is not good."""

    body: bytes
    samples: int
    endings: dict[int, str]
    nulls: list[int]
    is_odd: bool
    first_number: int
    last_number: int
    first_received_ms: int
    last_received_ms: int


def made(
    parts: Mapping[int, Part], headers: Mapping[int, HeaderOf], reasons: Mapping[int, str | None], about: Mapping[str, Any]
) -> Made:
    """The file that holds these samples."""
    places, (t, n, flags) = _places(parts.values())
    order = np.lexsort((flags, n, t))
    t, n, flags = t[order], n[order], flags[order]
    is_new = np.concatenate([[True], (np.diff(t) != 0) | (np.diff(n) != 0) | (np.diff(flags) != 0)])
    row_of = np.empty(len(t), dtype=np.int64)
    row_of[order] = np.cumsum(is_new) - 1
    rows = int(is_new.sum())
    columns = _header_columns(t[is_new], n[is_new], flags[is_new], headers, reasons)
    encodings = dict.fromkeys(_INTS, "DELTA_BINARY_PACKED")
    endings: dict[int, str] = {}
    nulls: list[list[int] | None] = [None] * rows
    texts = list(_TEXTS)
    for (sid, part), place in zip(parts.items(), places, strict=True):
        at = row_of[place]
        if part.kind is Kind.NULL:
            for row in at.tolist():
                nulls[row] = [*(nulls[row] or ()), sid]
            continue
        ending, values, encoding = sealed_column(part.kind, part.forms, at, rows)
        endings[sid], name = ending, f"s{sid}{ending}"
        columns[name] = values
        if encoding is not None:
            encodings[f"{name}.list.element" if ending[0] == "l" else name] = encoding
        elif ending == "t":
            texts.append(name)
    columns["nulls"] = pa.array(nulls, pa.list_(pa.int32()))
    body = parquet(pa.table(columns), about, use_dictionary=texts, column_encoding=encodings, write_statistics=["n", "t"])
    received = columns["received"].to_numpy()
    null_sids = [sid for sid, part in parts.items() if part.kind is Kind.NULL]
    is_odd = bool(null_sids) or bool(np.any(flags & RANK_MASK))
    figures = (int(n.min()), int(n.max()), int(received.min()), int(received.max()))
    return Made(body, sum(len(part.t) for part in parts.values()), endings, null_sids, is_odd, *figures)


def _places(parts: Iterable[Part]) -> tuple[list[slice], tuple[Ints, Ints, Ints]]:
    """Times, numbers and flags of all samples, and where among them those of each part are; parts may share theirs."""
    known: dict[tuple[int, int, int], slice] = {}
    places: list[slice] = []
    arrays: list[tuple[Ints, Ints, Ints]] = []
    end = 0
    for part in parts:
        key = id(part.t), id(part.numbers), id(part.flags)
        if key not in known:
            known[key] = slice(end, end := end + len(part.t))
            arrays.append((part.t, part.numbers, part.flags))
        places.append(known[key])
    t, n, flags = (np.concatenate(some) for some in zip(*arrays, strict=True))
    return places, (t, n, flags)


def parquet(table: Any, about: Mapping[str, Any], **how: Any) -> bytes:
    """The bytes of a file that says what is in it."""
    sink = pa.BufferOutputStream()
    with pq.ParquetWriter(sink, table.schema, compression="zstd", compression_level=6, store_schema=False, **how) as writer:
        writer.write_table(table, row_group_size=ROW_GROUP_ROWS)
        writer.add_key_value_metadata({METADATA: json.dumps(about)})
    return bytes(sink.getvalue().to_pybytes())


def _header_columns(
    t: Ints, n: Ints, flags: Ints, headers: Mapping[int, HeaderOf], reasons: Mapping[int, str | None]
) -> dict[str, Any]:
    received, stamps, nodes, is_data, places = zip(*map(headers.__getitem__, n.tolist()), strict=True)
    ms = t // 1000
    return {
        "n": pa.array(n),
        "t": pa.array(ms),
        "sub": pa.array((t - ms * 1000).astype(np.int32)),
        "received": pa.array(np.array(received, dtype=np.int64)),
        "lag": pa.array(np.array(stamps, dtype=np.int64) - ms),
        "node": pa.array(nodes, pa.string()),
        "data": pa.array(is_data, pa.bool_()),
        "quality": pa.array((flags & RANK_MASK).astype(np.int8)),
        "history": pa.array(flags & HISTORY_BIT != 0),
        "reason": pa.array([reasons[flag] for flag in (flags >> REASON_SHIFT).tolist()], pa.string()),
        "place": pa.array(places, pa.binary()),
    }


class Rows(NamedTuple):
    """A file, read: its samples by series, and the messages that they are of."""

    parts: dict[int, Part]
    headers: dict[int, HeaderOf]


def read_rows(table: Any, kinds: Mapping[int, Kind], reason_numbers: Mapping[str | None, int]) -> Rows:
    """The samples of a file again."""
    n = _ints(table["n"])
    ms = _ints(table["t"])
    t = ms * 1000 + _ints(table["sub"])
    reasons = np.array([reason_numbers[text] for text in table["reason"].to_pylist()], dtype=np.int64)
    history = table["history"].combine_chunks().to_numpy(zero_copy_only=False)
    flags = _ints(table["quality"]) + HISTORY_BIT * history.astype(np.int64) + (reasons << REASON_SHIFT)
    parts: dict[int, Part] = {}
    for name in table.column_names:
        if name[0] == "s" and name[1].isdigit():
            sid, ending = sid_and_ending(name)
            at, forms = forms_of(table[name], ending)
            parts[sid] = Part(kinds[sid], t[at], forms, flags[at], n[at])
    for sid, rows in _null_rows(table["nulls"]).items():
        at = np.array(rows, dtype=np.int64)
        parts[sid] = Part(Kind.NULL, t[at], [None] * len(rows), flags[at], n[at])
    stamps = ms + _ints(table["lag"])
    told = zip(
        _ints(table["received"]).tolist(), stamps.tolist(), table["node"].to_pylist(), table["data"].to_pylist(),
        table["place"].to_pylist(), strict=True,
    )  # fmt: skip
    return Rows(parts, dict(zip(n.tolist(), map(HeaderOf._make, told), strict=True)))


def _ints(column: Any) -> Ints:
    return np.asarray(column.combine_chunks().to_numpy(zero_copy_only=False), dtype=np.int64)


def _null_rows(column: Any) -> dict[int, list[int]]:
    found: dict[int, list[int]] = {}
    array = column.combine_chunks()
    for row in np.flatnonzero(array.is_valid().to_numpy(zero_copy_only=False)).tolist():
        for sid in array[row].as_py():
            found.setdefault(sid, []).append(row)
    return found


def sid_and_ending(name: str) -> tuple[int, str]:
    """Return what a column's name says.

    >>> sid_and_ending("s12e3"), sid_and_ending("s7lf")
    ((12, 'e3'), (7, 'lf'))
    """
    digits = 1
    while digits < len(name) and name[digits].isdigit():
        digits += 1
    return int(name[1:digits]), name[digits:]
