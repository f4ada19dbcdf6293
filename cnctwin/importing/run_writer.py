"""Writing a run log block by block, of whatever length: Parquet, or CSV where the name ends so.

The file stands under its name when it is whole; until then it is beside it, and is removed where something fails.
"""

import csv
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cnctwin.errors import UsageError
from cnctwin.importing.rows import Block
from cnctwin.importing.run_columns import Kind, kind_of
from cnctwin.importing.stamps import NS


class Written(NamedTuple):
    """A run log that was written."""

    rows: int
    first_ns: int
    last_ns: int
    step_s: float | None


def write_blocks(blocks: Iterable[Block], columns: Sequence[str], out: Path) -> Written:
    """Write the blocks of a recording. Raises UsageError where that cannot be done; what the blocks raise goes on."""
    schema = pa.schema([pa.field("t_s", pa.float64()), *(_field(name) for name in columns)])
    partial = out.with_name(f".{out.name}.{os.getpid()}.part")
    try:
        with _Sink(partial, schema, is_csv=out.suffix == ".csv") as sink:
            written = _write(blocks, schema, sink)
        partial.replace(out)
    except OSError as error:
        raise UsageError(f"{out}: cannot be written: {error.strerror or error}") from None
    finally:
        partial.unlink(missing_ok=True)
    return written


def _field(name: str) -> pa.Field:
    return pa.field(name, pa.string() if kind_of(name) is Kind.TEXT else pa.float64())


def _write(blocks: Iterable[Block], schema: pa.Schema, sink: "_Sink") -> Written:
    first_ns: int | None = None
    last_ns, rows = 0, 0
    steps: list[float] = []
    for block in blocks:
        first_ns = int(block.t_ns[0]) if first_ns is None else first_ns
        sink.write(_batch(block, schema, first_ns))
        rows, last_ns = rows + len(block.t_ns), int(block.t_ns[-1])
        if len(block.t_ns) > 1 and len(steps) < 100:
            steps.append(float(np.median(np.diff(block.t_ns))) / NS)
    if first_ns is None:
        raise UsageError("no row is left of the files")
    return Written(rows, first_ns, last_ns, float(np.median(steps)) if steps else None)


def _batch(block: Block, schema: pa.Schema, first_ns: int) -> pa.RecordBatch:
    arrays = [pa.array((block.t_ns - first_ns).astype(np.float64) / NS)]
    for entry in list(schema)[1:]:
        values = block.columns.get(entry.name)
        if values is None:
            arrays.append(pa.nulls(len(block.t_ns), entry.type))
        else:
            arrays.append(pa.array(values, type=entry.type, from_pandas=True))
    return pa.record_batch(arrays, schema=schema)


class _Sink:
    def __init__(self, path: Path, schema: pa.Schema, *, is_csv: bool) -> None:
        self._parquet = None if is_csv else pq.ParquetWriter(path, schema, compression="zstd")
        self._file = path.open("w", newline="", encoding="utf-8") if is_csv else None
        self._csv = csv.writer(self._file) if self._file else None
        if self._csv:
            self._csv.writerow(schema.names)

    def write(self, batch: pa.RecordBatch) -> None:
        if self._parquet is not None:
            self._parquet.write_batch(batch)
        elif self._csv is not None:
            columns: list[list[object]] = [column.to_pylist() for column in batch.columns]
            self._csv.writerows(["" if value is None else value for value in row] for row in zip(*columns, strict=True))

    def __enter__(self) -> "_Sink":
        return self

    def __exit__(self, *_: object) -> None:
        if self._parquet is not None:
            self._parquet.close()
        if self._file is not None:
            self._file.close()
