"""Readings as a Sparkplug payload in which each metric says its name, type, unit and quality, and such payloads as readings.

A host session reads data by the birth before it. A record of a log may be read by somebody who begins in the middle, so that it
carries what the birth said: the payload is the one of a DBIRTH, with the metrics of the message only. Any reader of Sparkplug B
reads it (`Payload`, 6.4.1).

>>> payload = written(1_790_000_000_000, (Reading("load", 37.5, 1_790_000_000_000, Quality.GOOD, "%", None, False),), 7)
>>> NamedPayloads().read(payload).readings[0].value
37.5
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from sparkplug.codec import datatype_of, parse, read_value, write_metric, write_properties
from sparkplug.datatype import DataType
from sparkplug.layouts.layout import Layout, Packed
from sparkplug.layouts.learning import learn
from sparkplug.layouts.memory import Memory, Room
from sparkplug.layouts.pieces import Pieces
from sparkplug.layouts.varint import written as varint
from sparkplug.metric import UNIT_PROPERTY, Reading, quality_properties
from sparkplug.metric_bytes import pack_double
from sparkplug.node_picture import told_of
from sparkplug.quality import Quality
from sparkplug.schema import PayloadMessage, PropertySetMessage
from sparkplug.values import DataSet, Metric, PropertyValue, Template

HEADS_MAX = 65_536
STAMP_SIZE = 7  # tag and varint of a time stamp of 1971 to 2109
NAMES_MAX = 4096
_GOOD = Quality.GOOD
_DOUBLE, _TEXT, _LONG = b"\x69", b"\x7a", b"\x58"
_TRUE, _FALSE, _NULL, _HISTORY = b"\x70\x01", b"\x70\x00", b"\x38\x01", b"\x28\x01"
_INT64_MAX = 2**63


class Named(NamedTuple):
    """A payload that was read. `names` and the stamps are as those of a `HostEvent`: () and 0 where a reading is historical."""

    timestamp_ms: int
    seq: int
    readings: tuple[Reading, ...]
    names: tuple[str, ...]
    oldest_ms: int
    newest_ms: int


def datatype_of_value(value: Any) -> DataType:
    """Return the type in which a value is written: the widest of its kind, since readings do not keep the declared one.

    >>> datatype_of_value(3).name, datatype_of_value((1.5, 2.0)).name
    ('INT64', 'DOUBLE_ARRAY')
    """
    kind = type(value)
    if kind is float or value is None:
        return DataType.DOUBLE
    if kind is bool:
        return DataType.BOOLEAN
    if kind is int:
        return DataType.INT64 if -_INT64_MAX <= value < _INT64_MAX else DataType.UINT64
    if kind is str:
        return DataType.STRING
    if kind is tuple:
        return _datatype_of_array(value)
    if isinstance(value, DataSet):
        return DataType.DATASET
    return DataType.TEMPLATE if isinstance(value, Template) else DataType.BYTES


def _datatype_of_array(values: tuple[Any, ...]) -> DataType:
    first = values[0] if values else 0.0
    if type(first) is bool:
        return DataType.BOOLEAN_ARRAY
    if type(first) is int:
        return DataType.UINT64_ARRAY if max(values) >= _INT64_MAX else DataType.INT64_ARRAY
    return DataType.STRING_ARRAY if type(first) is str else DataType.DOUBLE_ARRAY


def written(timestamp_ms: int, readings: Sequence[Reading], seq: int) -> bytes:
    """Return the payload with these readings. Raises PayloadError for a value that no metric can carry."""
    parts = [b"\x08", varint(timestamp_ms)]
    stamped_ms, stamp, doubles = -1, b"", _doubles
    for reading in readings:
        name, value, at_ms, quality, unit, reason, is_historical = reading
        if at_ms != stamped_ms:
            stamped_ms, stamp = at_ms, b"\x18" + varint(at_ms)
        if type(value) is float and quality is _GOOD and reason is None and not is_historical and len(stamp) == STAMP_SIZE:
            parts += (doubles.get((name, unit)) or _double(name, unit), pack_double(value), stamp)
        else:
            parts += _metric(reading, stamp)
    parts += (b"\x18", varint(seq))
    return b"".join(parts)


def handed_on(packed: Packed) -> bytes:
    """Return a packed message by names: its pieces, and between them what the birth said of each metric."""
    layout, payload = packed
    pieces = layout.pieces
    assert pieces is not None, "what is packed can be cut"
    template = pieces.template or _template(layout, pieces)
    return template % pieces.cut.unpack(payload)


def _template(layout: Layout, pieces: Pieces) -> bytes:
    parts = [b"%b"]
    for name, unit, datatype, size in zip(layout.names, layout.units, pieces.types, pieces.sizes, strict=True):
        head = _head(name, datatype, unit)
        parts += ((b"\x12" + varint(len(head) + size) + head).replace(b"%", b"%%"), b"%b")
    pieces.template = b"".join((*parts, b"%b"))
    return pieces.template


def _double(name: str, unit: str | None) -> bytes:
    """Return the bytes of a good double up to its value, behind which the stamp stands."""
    head = _told(name, DataType.DOUBLE, unit, _GOOD, None)
    if len(_doubles) >= HEADS_MAX:
        _doubles.clear()
    whole = _doubles[name, unit] = b"\x12" + varint(len(head) + 9 + STAMP_SIZE) + head + _DOUBLE
    return whole


_doubles: dict[tuple[str, str | None], bytes] = {}


def _metric(reading: Reading, stamp: bytes) -> tuple[bytes, ...]:
    """Return the bytes of any metric, in parts."""
    name, _, _, quality, unit, reason, is_historical = reading
    value: Any = reading.value
    kind = type(value)
    if kind is float:
        told, field = DataType.DOUBLE, _DOUBLE + pack_double(value)
    elif kind is bool:
        told, field = DataType.BOOLEAN, _TRUE if value else _FALSE
    elif kind is str:
        raw = value.encode()
        told, field = DataType.STRING, _TEXT + varint(len(raw)) + raw
    elif kind is int and 0 <= value < _INT64_MAX:
        told, field = DataType.INT64, _LONG + varint(value)
    elif value is None:
        told, field = DataType.DOUBLE, _NULL
    else:
        return (_by_protobuf(reading),)
    head = _head(name, told, unit) if quality is _GOOD and reason is None else _told(name, told, unit, quality, reason)
    body = b"".join((head, field, stamp, _HISTORY) if is_historical else (head, field, stamp))
    return b"\x12", varint(len(body)), body


def _told(name: str, datatype: DataType | None, unit: str | None, quality: Quality, reason: str | None) -> bytes:
    """Return the bytes of a metric that say what it is: name, type, unit, quality and reason."""
    raw = name.encode()
    told = b"\x0a" + varint(len(raw)) + raw + (b"" if datatype is None else b"\x20" + varint(datatype))
    if properties := _properties(unit, quality, reason):
        told += b"\x4a" + varint(len(properties)) + properties
    return told


@lru_cache(maxsize=HEADS_MAX)
def _head(name: str, datatype: DataType | None, unit: str | None) -> bytes:
    """Return what `_told` returns for a good value."""
    return _told(name, datatype, unit, Quality.GOOD, None)


@lru_cache(maxsize=HEADS_MAX)
def _properties(unit: str | None, quality: Quality, reason: str | None) -> bytes:
    properties = dict(quality_properties(quality, reason))
    if unit is not None:
        properties[UNIT_PROPERTY] = PropertyValue(DataType.STRING, unit)
    message = PropertySetMessage()
    write_properties(message, properties)
    raw: bytes = message.SerializeToString()
    return raw


def _by_protobuf(reading: Reading) -> bytes:
    """Return the bytes of a metric whose value only protobuf can write: negative numbers, arrays, tables, templates, bytes."""
    name, value, at_ms, quality, unit, reason, is_historical = reading
    properties = dict(quality_properties(quality, reason))
    if unit is not None:
        properties[UNIT_PROPERTY] = PropertyValue(DataType.STRING, unit)
    metric = Metric(name, value, datatype_of_value(value), at_ms, is_historical=is_historical, properties=properties)
    message = PayloadMessage()
    write_metric(message.metrics.add(), metric)
    raw: bytes = message.SerializeToString()
    return raw


class NamedPayloads:
    """Reads the payloads of one source, by remembered layouts where it can: messages of one layout share a tuple of names."""

    def __init__(self, room: Room | None = None) -> None:
        """`room`: the memory that the layouts of all sources share."""
        self._layouts = Memory(room or Room())
        self._names: dict[tuple[str, ...], tuple[str, ...]] = {}

    def read(self, payload: bytes) -> Named:
        """Return what a payload says. Raises PayloadError where it is none, or a metric of it says no name or type."""
        found = self._layouts.read(payload)
        if found is not None:
            layout, (stamp_ms, seq, values, stamps_ms, oldest_ms, newest_ms) = found
            readings = layout.readings(values, stamps_ms)
            if layout.has_history:
                return Named(stamp_ms, seq, readings, (), 0, 0)
            return tuple.__new__(Named, (stamp_ms, seq, readings, layout.names, oldest_ms, newest_ms))
        return self._read(payload)

    def _read(self, payload: bytes) -> Named:
        message = parse(payload)
        readings, datatypes = [], []
        for metric in message.metrics:
            datatype = datatype_of(metric.datatype)
            told = told_of(metric.properties)
            value = read_value(metric, datatype)
            at_ms = metric.timestamp
            readings.append(Reading(metric.name, value, at_ms, told.quality, told.unit, told.reason, metric.is_historical))
            datatypes.append(datatype)
        names = tuple([reading.name for reading in readings])
        if any(reading.is_historical for reading in readings):
            names = ()
        elif len(self._names) < NAMES_MAX:
            names = self._names.setdefault(names, names)
        if readings and self._layouts.may_learn():
            layout: Layout | None = learn(payload, datatypes, readings, names)
            if layout is not None:
                self._layouts.keep(layout)
        stamps_ms = [reading.timestamp_ms for reading in readings] if names else [0]
        return Named(message.timestamp, message.seq, tuple(readings), names, min(stamps_ms), max(stamps_ms))
