"""Array values packed into bytes (Sparkplug 3.0.0, 6.4.17, with the corrected examples of its successor).

Numbers stand little-endian one after another; booleans are a 4-byte count and then bits, the first in the highest bit of the
first byte; strings end with a zero byte each. (The examples of 3.0.0 print an Int8 of −23 as 0xEF and floats big-endian; the text
and the corrected examples say 0xE9 and little-endian.)

>>> pack(DataType.INT8_ARRAY, (-23, 123)).hex()
'e97b'
>>> pack(DataType.FLOAT_ARRAY, (1.23, 89.341)).hex()
'a4709d3f98aeb242'
"""

import struct
from collections.abc import Callable
from typing import Any

from sparkplug.datatype import DataType
from sparkplug.errors import MetricValueError, PayloadError

_CODES = {
    DataType.INT8_ARRAY: "b",
    DataType.INT16_ARRAY: "h",
    DataType.INT32_ARRAY: "i",
    DataType.INT64_ARRAY: "q",
    DataType.UINT8_ARRAY: "B",
    DataType.UINT16_ARRAY: "H",
    DataType.UINT32_ARRAY: "I",
    DataType.UINT64_ARRAY: "Q",
    DataType.FLOAT_ARRAY: "f",
    DataType.DOUBLE_ARRAY: "d",
    DataType.DATETIME_ARRAY: "q",
}
ELEMENTS_MAX = 1_000_000  # that are read; eight booleans take one byte on the wire and 64 here
_COUNT = struct.Struct("<I")


def pack(datatype: DataType, values: tuple[Any, ...]) -> bytes:
    """Pack `values` as `datatype`; raises MetricValueError where one does not fit."""
    try:
        if datatype is DataType.BOOLEAN_ARRAY:
            return _pack_booleans(values)
        if datatype is DataType.STRING_ARRAY:
            return _pack_strings(values)
        return struct.pack(f"<{len(values)}{_CODES[datatype]}", *values)
    except (struct.error, OverflowError, TypeError, AttributeError, UnicodeEncodeError) as error:
        raise MetricValueError(f"{values!r:.80} does not fit {datatype.name}: {error}") from error


def unpack(datatype: DataType, data: bytes) -> tuple[Any, ...]:
    """Unpack bytes into a tuple; raises PayloadError where the length does not fit."""
    unpackers: dict[DataType, Callable[[bytes], tuple[Any, ...]]] = {
        DataType.BOOLEAN_ARRAY: _unpack_booleans,
        DataType.STRING_ARRAY: _unpack_strings,
    }
    if datatype in unpackers:
        return unpackers[datatype](data)
    code = _CODES[datatype]
    size = struct.calcsize(code)
    _check_count(datatype, len(data) // size)
    if len(data) % size:
        raise PayloadError(f"{datatype.name} of {len(data)} bytes is not a whole number of {size}-byte elements")
    return struct.unpack(f"<{len(data) // size}{code}", data)


def _check_count(datatype: DataType, count: int) -> None:
    if count > ELEMENTS_MAX:
        raise PayloadError(f"{datatype.name} of {count} elements is above the limit of {ELEMENTS_MAX}")


def _pack_booleans(values: tuple[bool, ...]) -> bytes:
    if not all(isinstance(value, bool) for value in values):
        raise TypeError("every element must be a bool")
    bits = bytearray((len(values) + 7) // 8)
    for index, value in enumerate(values):
        if value:
            bits[index // 8] |= 0x80 >> index % 8
    return _COUNT.pack(len(values)) + bytes(bits)


def _unpack_booleans(data: bytes) -> tuple[bool, ...]:
    if len(data) < _COUNT.size:
        raise PayloadError(f"BOOLEAN_ARRAY of {len(data)} bytes lacks its 4-byte count")
    (count,) = _COUNT.unpack_from(data)
    bits = data[_COUNT.size :]
    if count > 8 * len(bits):
        raise PayloadError(f"BOOLEAN_ARRAY says {count} elements and carries {8 * len(bits)}")
    _check_count(DataType.BOOLEAN_ARRAY, count)
    return tuple(bool(bits[index // 8] & (0x80 >> index % 8)) for index in range(count))


def _pack_strings(values: tuple[str, ...]) -> bytes:
    if any("\0" in value for value in values):
        raise TypeError("a zero byte cannot stand inside a string of an array")
    return b"".join(value.encode() + b"\0" for value in values)


def _unpack_strings(data: bytes) -> tuple[str, ...]:
    if data and not data.endswith(b"\0"):
        raise PayloadError("STRING_ARRAY does not end with a zero byte")
    _check_count(DataType.STRING_ARRAY, data.count(b"\0"))
    try:
        return tuple(part.decode() for part in data.split(b"\0")[:-1])
    except UnicodeDecodeError as error:
        raise PayloadError(f"STRING_ARRAY holds bytes that are not UTF-8: {error}") from error
