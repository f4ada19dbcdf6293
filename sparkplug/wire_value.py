"""Scalar and array values to protobuf fields and back, one pair of functions for each datatype.

Whole numbers are range-checked going out and sign-corrected coming in: a negative number travels as two's complement in an
unsigned field, some peers widen it to 32 or 64 bits and some do not, so what comes in is cut to the declared width first.

>>> WRITE[DataType.INT8](-23)
4294967273
>>> READ[DataType.INT8](4294967273), READ[DataType.INT8](0xE9)
(-23, -23)
"""

import struct
from collections.abc import Callable
from typing import Any

from sparkplug import arrays
from sparkplug.datatype import ARRAYS, BINARIES, SIGNED_BITS, TEXTS, UNSIGNED_BITS, DataType
from sparkplug.errors import MetricValueError, PayloadError

_FLOAT = struct.Struct("<f")


def _integer_out(datatype: DataType, bits: int, *, signed: bool) -> Callable[[Any], int]:
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    mask = (1 << max(bits, 32)) - 1

    def out(value: Any) -> int:
        if type(value) is not int or not low <= value <= high:
            raise MetricValueError(f"{value!r} is not a {datatype.name} ({low} to {high})")
        return value & mask

    return out


def _integer_in(bits: int, *, signed: bool) -> Callable[[Any], int]:
    mask, sign = (1 << bits) - 1, 1 << bits - 1

    def into(value: Any) -> int:
        cut: int = value & mask
        return (cut ^ sign) - sign if signed else cut

    return into


def _exact(datatype: DataType, types: tuple[type, ...], cast: Callable[[Any], Any]) -> Callable[[Any], Any]:
    def out(value: Any) -> Any:
        if not isinstance(value, types) or (isinstance(value, bool) and bool not in types):
            raise MetricValueError(f"{value!r:.80} is not a {datatype.name}")
        try:
            return cast(value)
        except (OverflowError, UnicodeEncodeError) as error:
            raise MetricValueError(f"{value!r:.80} is not a {datatype.name}: {error}") from error

    return out


def _single(value: float) -> float:
    """A number that fits 32 bits; protobuf would silently make it infinite."""
    number = float(value)
    _FLOAT.pack(number)
    return number


def _text(value: str) -> str:
    """A text that UTF-8 can write (a lone surrogate it cannot)."""
    if not value.isascii():
        value.encode()
    return value


def _array_out(datatype: DataType) -> Callable[[Any], bytes]:
    def out(value: Any) -> bytes:
        if not isinstance(value, tuple):
            raise MetricValueError(f"{value!r:.80} is not a {datatype.name}; give a tuple")
        return arrays.pack(datatype, value)

    return out


def _array_in(datatype: DataType) -> Callable[[Any], tuple[Any, ...]]:
    return lambda data: arrays.unpack(datatype, data)


def _text_in(value: Any) -> Any:
    if not isinstance(value, str):  # what protobuf makes of bytes that are not UTF-8
        raise PayloadError(f"{value!r:.40} is no UTF-8 text")
    return value


def _same(value: Any) -> Any:
    return value


WRITE: dict[DataType, Callable[[Any], Any]] = {
    **{t: _integer_out(t, bits, signed=True) for t, bits in SIGNED_BITS.items()},
    **{t: _integer_out(t, bits, signed=False) for t, bits in UNSIGNED_BITS.items()},
    DataType.FLOAT: _exact(DataType.FLOAT, (float, int), _single),
    DataType.DOUBLE: _exact(DataType.DOUBLE, (float, int), float),
    DataType.BOOLEAN: _exact(DataType.BOOLEAN, (bool,), bool),
    **{t: _exact(t, (str,), _text) for t in TEXTS},
    **{t: _exact(t, (bytes,), bytes) for t in BINARIES},
    **{t: _array_out(t) for t in ARRAYS},
}
"""The protobuf value of a value; raises MetricValueError where the type cannot carry it."""
READ: dict[DataType, Callable[[Any], Any]] = {
    **{t: _integer_in(bits, signed=True) for t, bits in SIGNED_BITS.items()},
    **{t: _integer_in(bits, signed=False) for t, bits in UNSIGNED_BITS.items()},
    **dict.fromkeys((DataType.FLOAT, DataType.DOUBLE), float),
    DataType.BOOLEAN: bool,
    **dict.fromkeys(TEXTS, _text_in),
    **dict.fromkeys(BINARIES, _same),
    **{t: _array_in(t) for t in ARRAYS},
}
"""The Python value of a protobuf field; raises PayloadError where an array's bytes do not fit."""
