"""Any Parquet file, in batches of rows; columns that hold lists or structures are left out."""

from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from cnctwin.errors import UsageError
from cnctwin.importing.column_map import FileOptions
from cnctwin.importing.dialects.contract import Content, Dialect, Faults, Head, Piece, SourceColumn, Times
from cnctwin.importing.dialects.layout import named

ROWS = 65_536
ROW_GROUP_BYTES_MAX = 1024 * 1024 * 1024


def _is_plain(kind: pa.DataType) -> bool:
    return not (pa.types.is_nested(kind) or pa.types.is_fixed_size_binary(kind) or pa.types.is_binary(kind))


def _reads(path: Path, _head: Head, _options: FileOptions) -> Content:
    try:
        with pq.ParquetFile(path) as file:
            schema, footer = file.schema_arrow, file.metadata
            largest = max((footer.row_group(group).total_byte_size for group in range(footer.num_row_groups)), default=0)
    except (OSError, UnicodeDecodeError, pa.ArrowException) as error:
        raise UsageError(f"{path}: cannot be read as Parquet: {(str(error).splitlines() or ['?'])[0]}") from None
    if largest > ROW_GROUP_BYTES_MAX:
        raise UsageError(f"{path}: a row group unpacks to {largest} bytes; {ROW_GROUP_BYTES_MAX} are read: write smaller ones")
    plain = [entry.name for entry in schema if _is_plain(entry.type) and schema.names.count(entry.name) == 1]
    faults = Faults()
    faults.count("columns that hold lists, structures or bytes", len(schema.names) - len(plain))

    def pieces() -> Iterator[Piece]:
        try:
            with pq.ParquetFile(path) as file:
                for batch in file.iter_batches(batch_size=ROWS, columns=plain, use_threads=False):
                    yield Piece(0, {name: _decoded(batch.column(name)) for name in plain})
        except (OSError, UnicodeDecodeError, pa.ArrowException) as error:
            raise UsageError(f"{path}: cannot be read further: {(str(error).splitlines() or ['?'])[0]}") from None

    columns = tuple(SourceColumn(name, _time_unit(schema.field(name).type) or named(name)[1]) for name in plain)
    return Content(columns, (Times(),), pieces, faults)


def _time_unit(kind: pa.DataType) -> str:
    return "ISO 8601" if pa.types.is_timestamp(kind) else ""


def _decoded(values: pa.Array) -> pa.Array:
    return values.dictionary_decode() if pa.types.is_dictionary(values.type) else values


DIALECT = Dialect(name="Parquet", recognises=lambda head: head.raw.startswith(b"PAR1"), reads=_reads)
