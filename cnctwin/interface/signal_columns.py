"""The columns of a store as Arrow columns over one time: a row for each moment at which a signal said something."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from cnctwin.memory.store.contract import Column, Sample, StoreError
from sparkplug.quality import Quality
from twin.vocabulary.signals import Kind, canonical

TIME = pa.timestamp("us", tz="UTC")
_KINDS = {Kind.NUMBER: pa.float64(), Kind.INTEGER: pa.float64(), Kind.FLAG: pa.bool_(), Kind.TEXT: pa.string()}
_WORDS = pa.dictionary(pa.int8(), pa.string())
_DETAILS = (("quality", _WORDS), ("reason", pa.string()))
_WINDOW_DETAILS = (*_DETAILS, ("low", pa.float64()), ("high", pa.float64()), ("count", pa.int64()))
_SAME_MOMENT = 1024
"""More samples of one signal than that in one microsecond there are not: a store numbers them by it."""


def type_of(signal: str, latest: Mapping[str, Sample]) -> pa.DataType:
    """Return the type of a signal's column: of a canonical signal what it means, else what it said last; numbers are doubles.

    >>> str(type_of("spindle_rpm", {})), str(type_of("exec_state", {})), str(type_of("coolant_on", {}))
    ('double', 'string', 'bool')
    """
    if (known := canonical(signal)) is not None:
        return _KINDS[known.kind]
    value = latest[signal].value if signal in latest else None
    if isinstance(value, tuple):
        return pa.list_(pa.string() if value and isinstance(value[0], str) else pa.float64())
    for kind, arrow in ((bool, pa.bool_()), (str, pa.string()), (bytes, pa.binary())):
        if isinstance(value, kind):
            return arrow
    return pa.float64()


def schema_of(types: Mapping[str, pa.DataType], units: Mapping[str, str | None], *, windows: bool, details: bool) -> pa.Schema:
    """Return the schema: `t`, each signal with its unit, and with `details` what stands beside it."""
    fields = [pa.field("t", TIME, nullable=False)]
    for signal, kind in types.items():
        unit = units.get(signal)
        fields.append(pa.field(signal, kind, metadata={"unit": unit} if unit else None))
        if details:
            fields += [pa.field(f"{signal}.{name}", of) for name, of in (_WINDOW_DETAILS if windows else _DETAILS)]
    return pa.schema(fields)


def batch_of(columns: Sequence[Column], schema: pa.Schema, *, windows: bool, details: bool) -> pa.RecordBatch:
    """Return the rows of these columns, oldest first.

    Without `details` a sample that is not good is null, since nothing beside it would say so; a window's value is that of its
    good samples anyway. Raises StoreError where a signal holds a value that its column's type cannot.
    """
    keys = [_keys(column.t_us) for column in columns]
    rows = np.unique(np.concatenate(keys)) if keys else np.zeros(0, dtype=np.int64)
    arrays = [pa.array(rows // _SAME_MOMENT, type=pa.int64()).cast(TIME)]
    for column, key in zip(columns, keys, strict=True):
        at = np.searchsorted(rows, key)
        shows_all = windows or details
        value = [v if shows_all or q is Quality.GOOD else None for v, q in zip(column.value, column.quality, strict=True)]
        kind = schema.field(column.signal).type
        arrays.append(_spread(_fitting(column, value, kind), at, len(rows), kind))
        if details:
            told: dict[str, Sequence[Any]] = {"quality": [q.name.lower() for q in column.quality], "reason": column.reason}
            told |= {"low": column.low, "high": column.high, "count": column.count} if windows else {}
            arrays += [_spread(v, at, len(rows), schema.field(f"{column.signal}.{name}").type) for name, v in told.items()]
    return pa.RecordBatch.from_arrays(arrays, schema=schema)


def _keys(t_us: Sequence[int]) -> NDArray[np.int64]:
    """The moments as numbers that tell apart samples of one signal at the same microsecond, in their order."""
    moments = np.array(t_us, dtype=np.int64)
    first = np.searchsorted(moments, moments, side="left")
    return moments * _SAME_MOMENT + (np.arange(len(moments)) - first)


def _spread(values: Sequence[Any], at: NDArray[np.intp], rows: int, kind: pa.DataType) -> pa.Array:
    spread: list[Any] = [None] * rows
    for place, value in zip(at.tolist(), values, strict=True):
        spread[place] = value
    return pa.array(spread, type=kind)


def _fitting(column: Column, values: Sequence[Any], kind: pa.DataType) -> Sequence[Any]:
    if kind == pa.string():
        return [None if value is None else str(value) for value in values]
    numbers = kind == pa.float64()
    fits = (int, float) if numbers else {pa.bool_(): bool, pa.binary(): bytes}.get(kind, tuple)
    for t_us, value in zip(column.t_us, values, strict=True):
        if value is not None and (not isinstance(value, fits) or (numbers and isinstance(value, bool))):
            at = datetime.fromtimestamp(t_us / 1e6, UTC).isoformat(timespec="milliseconds")
            raise StoreError(
                f"{column.signal}: is {value!r} at {at}, which is no {kind}; read it with as_text=[{column.signal!r}]"
            )
    return [None if value is None else float(value) for value in values] if numbers else values
