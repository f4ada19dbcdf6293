"""One series as a column of a Parquet file, losslessly and small.

Figures of a control have few decimals: a column of floats is kept as whole numbers n of 10^-d, as differences, where n / 10^d is
the value for every one of them, to the last bit. (n and 10^d are exact as doubles, so that the quotient is the double nearest to
the decimal, which is what reading that decimal gives.) Else it is kept as floats of four bytes where they are exact, or of eight.

The ending of a column's name says how it is kept: `s12e3` is series 12 in thousandths; `z3` in halves of them, where 1 is the
negative zero that rounding leaves; `f` and `d` are floats of 4 and 8 bytes, `i` whole numbers, `b` truth, `t` texts, `x` bytes;
an `l` before it a list of these.
"""

import struct
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from cnctwin.memory.store.value_form import Kind

DECIMALS_MAX = 9
EXACT_MAX = 2.0**52
_TRIED_FIRST = 64
_DELTA, _SPLIT = "DELTA_BINARY_PACKED", "BYTE_STREAM_SPLIT"
_LETTERS = {"b": np.int8, "h": np.int16, "i": np.int32, "q": np.int64, "f": np.float32, "d": np.float64, "?": np.bool_}


class SealedColumn(NamedTuple):
    """A column as it is kept (the ending of its name), its values, and Parquet's encoding where it is not the usual one."""

    ending: str
    values: Any
    encoding: str | None


def decimals(values: NDArray[np.float64]) -> int | None:
    """Return how many decimals all of these have, exactly; None where that is not so.

    >>> decimals(np.array([0.125, -3.5, 7.0])), decimals(np.array([0.1 + 0.2])), decimals(np.array([-0.0]))
    (3, None, None)
    """
    first = 0
    for some in (values[:_TRIED_FIRST], values):
        for d in range(first, DECIMALS_MAX + 1):
            if _is_exact(some, d):
                first = d
                break
        else:
            return None
    return first


def _is_exact(values: NDArray[np.float64], d: int) -> bool:
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = np.rint(values * 10.0**d)
        if not bool(np.all(np.abs(scaled) < EXACT_MAX)):
            return False
        return np.array_equal((scaled.astype(np.int64) / 10.0**d).view(np.int64), values.view(np.int64))


def sealed_column(kind: Kind, forms: list[Any], at: NDArray[np.int64], rows: int) -> SealedColumn:
    """The column of a series: forms, as SQLite has them, at some of the rows."""
    if kind is Kind.FLOAT:
        ending, numbers, encoding = _numbers(_floats(forms))
        return SealedColumn(ending, _spread(numbers, at, rows), encoding)
    if kind is Kind.INT:
        return SealedColumn("i", _spread(np.array(forms, dtype=np.int64), at, rows), _DELTA)
    if kind is Kind.BOOL:
        return SealedColumn("b", _spread(np.array(forms, dtype=np.bool_), at, rows), None)
    if kind in (Kind.FLOATS, Kind.INTS, Kind.BOOLS):
        return _lists(kind, forms, at, rows)
    spread: list[Any] = [None] * rows
    for row, form in zip(at.tolist(), forms, strict=True):
        spread[row] = form
    return (
        SealedColumn("x", pa.array(spread, pa.binary()), None)
        if kind is Kind.BYTES
        else SealedColumn("t", pa.array(spread, pa.string()), None)
    )


def _floats(forms: list[Any]) -> NDArray[np.float64]:
    try:
        return np.array(forms, dtype=np.float64)
    except (TypeError, ValueError):  # a NaN is bytes in SQLite
        return np.array([struct.unpack("<d", form)[0] if isinstance(form, bytes) else form for form in forms], dtype=np.float64)


def _numbers(values: NDArray[np.float64]) -> tuple[str, NDArray[Any], str]:
    if (d := decimals(values)) is not None:
        return f"e{d}", np.rint(values * 10.0**d).astype(np.int64), _DELTA
    is_negative_zero = (values == 0.0) & np.signbit(values)
    if is_negative_zero.any() and (d := decimals(np.where(is_negative_zero, 0.0, values))) is not None:
        return f"z{d}", 2 * np.rint(values * 10.0**d).astype(np.int64) + is_negative_zero, _DELTA
    with np.errstate(over="ignore", invalid="ignore"):
        single = values.astype(np.float32)
        exact = np.array_equal(single.astype(np.float64).view(np.int64), values.view(np.int64))
    return ("f", single, _SPLIT) if exact else ("d", values, _SPLIT)


def _spread(values: NDArray[Any], at: NDArray[np.int64], rows: int) -> Any:
    if len(values) == rows:
        return pa.array(values[np.argsort(at, kind="stable")])
    spread, missing = np.zeros(rows, dtype=values.dtype), np.ones(rows, dtype=np.bool_)
    spread[at], missing[at] = values, False
    return pa.array(spread, mask=missing)


def _lists(kind: Kind, forms: list[bytes], at: NDArray[np.int64], rows: int) -> SealedColumn:
    order = np.argsort(at, kind="stable").tolist()
    arrays: list[NDArray[Any]] = [np.frombuffer(forms[i], dtype=_LETTERS[chr(forms[i][0])], offset=1) for i in order]
    lengths, missing = np.zeros(rows, dtype=np.int32), np.ones(rows, dtype=np.bool_)
    lengths[at[order]], missing[at] = [len(array) for array in arrays], False
    offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
    ending, encoding = "b", None
    if kind is Kind.FLOATS:
        ending, flat, encoding = _numbers(np.concatenate([array.astype(np.float64) for array in arrays]))
    elif kind is Kind.INTS:
        ending, flat, encoding = "i", np.concatenate([array.astype(np.int64) for array in arrays]), _DELTA
    else:
        flat = np.concatenate(arrays)
    return SealedColumn(
        "l" + ending, pa.ListArray.from_arrays(pa.array(offsets), pa.array(flat), mask=pa.array(missing)), encoding
    )


def forms_of(column: Any, ending: str) -> tuple[NDArray[np.int64], list[Any]]:
    """The rows at which there is a value, and the values as SQLite would have them (a NaN as itself)."""
    column = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    at = np.flatnonzero(column.is_valid().to_numpy(zero_copy_only=False))
    present = column.drop_null()
    if ending.startswith("l"):
        return at, _list_forms(present, ending[1:])
    if ending[0] in "tx":
        return at, present.to_pylist()
    return at, _back(present.to_numpy(zero_copy_only=False), ending).tolist()


def _back(values: NDArray[Any], ending: str) -> NDArray[Any]:
    if ending[0] == "e":
        return values / 10.0 ** int(ending[1:])
    if ending[0] == "z":
        return np.where(values & 1, -0.0, (values & ~1) / (2.0 * 10.0 ** int(ending[1:])))
    return values.astype(np.float64) if ending == "f" else values


def _list_forms(present: Any, ending: str) -> list[bytes]:
    flat = _back(present.flatten().to_numpy(zero_copy_only=False), ending)
    letter = b"?" if ending == "b" else b"q" if ending == "i" else b"d"
    ends = np.cumsum(present.value_lengths().to_numpy(zero_copy_only=False)).tolist()
    return [letter + flat[start:end].tobytes() for start, end in zip([0, *ends[:-1]], ends, strict=True)]
