"""Data metrics written without protobuf: the bytes that it would write, from parts that are kept for each metric.

>>> DataTemplate(5, DataType.DOUBLE).written(1.5, 1_790_000_000_000).hex()
'121210051880d8c1a28c3469000000000000f83f'
"""

from collections.abc import Callable
from functools import lru_cache
from struct import Struct
from typing import Any

from sparkplug.datatype import FIELD, TEXTS, DataType
from sparkplug.layouts.varint import written
from sparkplug.wire_value import WRITE

STAMP_BYTES = 6
STAMP_MS_MIN, STAMP_MS_MAX = 1 << 35, (1 << 42) - 1  # 1971 to 2109: varints of six bytes
DOUBLE_TAG = b"\x69"
pack_double = Struct("<d").pack
_pack_float = Struct("<f").pack
_TAGS = {"int_value": b"\x50", "long_value": b"\x58", "float_value": b"\x65", "double_value": DOUBLE_TAG}
_FLAGS = {True: b"\x70\x01", False: b"\x70\x00"}
_TRANSIENT, _NULL = b"\x30\x01", b"\x38\x01"
TEMPLATES_MAX = 65_536


@lru_cache
def _value_writer(datatype: DataType) -> Callable[[Any], bytes] | None:
    """Return what writes a value with its tag, raising MetricValueError as `WRITE` does; None where only protobuf can."""
    if datatype not in WRITE:
        return None
    write, name = WRITE[datatype], FIELD[datatype]
    tag = _TAGS.get(name, b"")
    if datatype is DataType.DOUBLE:
        return lambda value: tag + pack_double(write(value))
    if datatype is DataType.FLOAT:
        return lambda value: tag + _pack_float(write(value))
    if datatype is DataType.BOOLEAN:
        return lambda value: _FLAGS[write(value)]
    if datatype in TEXTS:
        return lambda value: _text(write(value).encode())
    return (lambda value: tag + written(write(value))) if tag else None


def _text(raw: bytes) -> bytes:
    return b"\x7a" + written(len(raw)) + raw


class DataTemplate:
    """The constant bytes of a metric: its alias, its type, and whether it is transient.

    `head` is what goes before the time stamp where the metric is a plain double: with STAMP_BYTES bytes of time stamp, the tag
    and eight bytes of value its length is known; else it is empty.
    """

    __slots__ = ("_alias", "_datatype", "_flags", "_write", "head")

    def __init__(self, alias: int, datatype: DataType, *, is_transient: bool = False) -> None:
        self._alias = b"\x10" + written(alias) + b"\x18"
        self._datatype = b"\x20" + written(datatype)
        self._flags = _TRANSIENT if is_transient else b""
        self._write = _value_writer(datatype)
        is_plain = datatype is DataType.DOUBLE and not is_transient
        self.head = b"\x12" + written(len(self._alias) + STAMP_BYTES + 9) + self._alias if is_plain else b""

    def written(self, value: Any, timestamp_ms: int) -> bytes | None:
        """Return the metric of a data message as a field of its payload; None where protobuf has to write it."""
        if self._write is None or type(timestamp_ms) is not int or not 0 <= timestamp_ms <= STAMP_MS_MAX:
            return None
        body = self._alias + written(timestamp_ms) + self._flags + self._write(value)
        return b"\x12" + written(len(body)) + body

    def declared(self, name: str, value: Any, timestamp_ms: int, properties: bytes) -> bytes | None:
        """Return the metric of a birth, which has a name, its type and properties, in the same way."""
        if self._write is None or type(timestamp_ms) is not int or not 0 <= timestamp_ms <= STAMP_MS_MAX:
            return None
        raw, told = name.encode(), b""
        if properties:
            told = b"\x4a" + written(len(properties)) + properties
        what = _NULL + told if value is None else told + self._write(value)
        body = b"\x0a" + written(len(raw)) + raw + self._alias + written(timestamp_ms) + self._datatype + self._flags + what
        return b"\x12" + written(len(body)) + body


data_template = lru_cache(maxsize=TEMPLATES_MAX)(DataTemplate)
"""The template of an alias and type: nodes that number their metrics alike share it."""
