"""The columns of a run log's file, within bounds: what a file becomes in memory is known before any of it is decoded.

A Parquet file of 11 MB can hold 2.6 thousand million values of one run-length each, which are 20.8 GB. Its footer tells rows,
types, encodings and sizes; what goes beyond the bounds, or could, is refused by it. All of this raises RunLogError, OSError or
pa.ArrowException.
"""

import csv
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from twin.errors import RunLogError

CELLS_MAX = 100_000_000  # rows times columns: 0.8 GB as numbers
BYTES_MAX = 1024 * 1024 * 1024  # of all columns that are read, unpacked
TEXT_BYTES_MAX = 64 * 1024 * 1024  # of the different texts of a column
CSV_BYTES_MAX = 64 * 1024 * 1024  # which take some twenty times as much while they are read
_TEXT_ENCODINGS = frozenset({"PLAIN", "RLE", "BIT_PACKED", "PLAIN_DICTIONARY", "RLE_DICTIONARY"})
_SHORTER = "read a shorter stretch of it, or fewer columns"


def parquet_columns(path: Path, numbers: Collection[str], texts: Collection[str]) -> dict[str, NDArray[Any]]:
    """Return those of these columns that the file has."""
    with pq.ParquetFile(path) as file:
        kinds = {field.name: field.type for field in file.schema_arrow}
    with pq.ParquetFile(path, read_dictionary=[name for name in texts if name in kinds and _is_text(kinds[name])]) as file:
        wanted = [name for name in kinds if name in numbers or name in texts]
        _check(path, file.metadata, wanted, texts)
        for name in wanted:
            if name in numbers and not _is_number(kinds[name]):
                raise RunLogError(f"{path}: column {name} holds what is not a number ({kinds[name]})")
            if pa.types.is_nested(kinds[name]):
                raise RunLogError(f"{path}: column {name} holds what is not a text ({kinds[name]})")
        # One at a time: what is read stands in memory twice.
        return {name: _values(path, name, file.read(columns=[name], use_threads=False).column(0)) for name in wanted}


def parquet_names(path: Path) -> list[str]:
    """Return the names of the columns."""
    with pq.ParquetFile(path) as file:
        return list(file.schema_arrow.names)


def csv_columns(path: Path) -> dict[str, NDArray[np.object_]]:
    """Return the columns of a CSV file."""
    if (size := path.stat().st_size) > CSV_BYTES_MAX:
        raise RunLogError(f"{path}: has {size} bytes; of a CSV file {CSV_BYTES_MAX} are read: write it as Parquet, or {_SHORTER}")
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = list(csv.reader(file)) or [[]]
    for number, row in enumerate(rows, start=2):
        if len(row) != len(header):
            raise RunLogError(f"{path}: line {number} has {len(row)} fields, the header has {len(header)}")
    flags: Mapping[str, float | None] = {"true": 1.0, "false": 0.0, "": None}
    return {
        name: np.array([flags.get(v.lower(), v) for v in column] or [], dtype=object)
        for name, column in zip(header, zip(*rows, strict=True) if rows else [()] * len(header), strict=True)
    }


def _check(path: Path, footer: Any, wanted: Collection[str], texts: Collection[str]) -> None:
    cells, size = footer.num_rows * max(len(wanted), 1), 0
    if cells > CELLS_MAX:
        raise RunLogError(
            f"{path}: has {footer.num_rows} rows in {len(wanted)} columns of a run log, {cells} values; "
            f"{CELLS_MAX} are read: {_SHORTER}"
        )
    for group in range(footer.num_row_groups):
        columns = footer.row_group(group)
        for at in range(columns.num_columns):
            column = columns.column(at)
            name = column.path_in_schema.partition(".")[0]
            if name not in wanted:
                continue
            size += column.total_uncompressed_size
            if column.num_values > footer.num_rows:
                raise RunLogError(
                    f"{path}: column {name} has {column.num_values} values in {footer.num_rows} rows; a row has one"
                )
            if name in texts and (odd := set(column.encodings) - _TEXT_ENCODINGS):
                raise RunLogError(
                    f"{path}: text {name} is encoded as {min(odd)}, which has no bound; write it as plain or dictionary"
                )
    if size > BYTES_MAX:
        raise RunLogError(f"{path}: unpacks to {size} bytes; {BYTES_MAX} are read: {_SHORTER}")


def _is_text(kind: Any) -> bool:
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return any(of(kind) for of in (pa.types.is_string, pa.types.is_large_string, pa.types.is_binary, pa.types.is_large_binary))


def _is_number(kind: Any) -> bool:
    return not (_is_text(kind) or pa.types.is_nested(kind) or pa.types.is_fixed_size_binary(kind))


def _values(path: Path, name: str, column: Any) -> NDArray[Any]:
    if not pa.types.is_dictionary(column.type):
        values: NDArray[Any] = column.to_numpy(zero_copy_only=False)
        return values
    parts: list[NDArray[Any]] = []
    for chunk in column.chunks:  # each text once, however many rows have it
        if chunk.dictionary.nbytes > TEXT_BYTES_MAX:
            raise RunLogError(
                f"{path}: the texts of {name} have {chunk.dictionary.nbytes} bytes; {TEXT_BYTES_MAX} are read: {_SHORTER}"
            )
        different = np.array([*chunk.dictionary.to_pylist(), None], dtype=object)
        parts.append(different[chunk.indices.fill_null(len(different) - 1).to_numpy(zero_copy_only=False)])
    return np.concatenate(parts) if parts else np.array([], dtype=object)
