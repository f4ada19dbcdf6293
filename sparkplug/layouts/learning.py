"""Learns the byte layout of a data message that was read the long way.

Only what peers usually send is learnt: time stamp, metrics and sequence number in the order of their fields, each field at most
once, tags of one byte. Everything else goes the long way each time.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from itertools import repeat
from struct import Struct
from typing import Any, NamedTuple

from sparkplug.datatype import SIGNED_BITS, UNSIGNED_BITS, DataType
from sparkplug.layouts.layout import Layout
from sparkplug.layouts.pieces import Pieces
from sparkplug.layouts.varint import number
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from sparkplug.wire_value import READ

LENGTH_MAX = 8192
VARINT_BYTES_MAX = 9  # 63 bits; a negative Int64 takes ten
_VARINT, _DOUBLE, _BYTES, _FLOAT = 0, 1, 2, 5  # wire types of protobuf
_TIMESTAMP, _METRIC, _SEQ = (1, _VARINT), (2, _BYTES), (3, _VARINT)
_HEADS, _TYPE = (1, 2), 4
_STAMP, _IS_NULL, _INT, _LONG, _SINGLE, _FLOATING, _BOOLEAN, _TEXT = 3, 7, 10, 11, 12, 13, 14, 15
# Of each field of a metric that may stand in a layout: its wire type.
_FIELDS = {
    1: _BYTES,
    2: _VARINT,
    _STAMP: _VARINT,
    4: _VARINT,
    5: _VARINT,
    6: _VARINT,
    _IS_NULL: _VARINT,
    8: _BYTES,
    9: _BYTES,
    _INT: _VARINT,
    _LONG: _VARINT,
    _SINGLE: _FLOAT,
    _FLOATING: _DOUBLE,
    _BOOLEAN: _VARINT,
    _TEXT: _BYTES,
}
_UNKNOWN = {_INT: DataType.UINT32, _LONG: DataType.UINT64}  # the type of a whole number whose birth told none
_BITS = SIGNED_BITS | UNSIGNED_BITS


class _UnusualError(Exception):
    """The message has a form that is not learnt."""


class _Field(NamedTuple):
    """One field of a protobuf message, and where its content stands."""

    number: int
    wire: int
    start: int
    end: int


class _Draft:
    """The parts of a layout, gathered field by field."""

    def __init__(self, payload: bytes) -> None:
        self.payload = payload
        self.mask = bytearray(b"\xff" * len(payload))
        self.stamps: list[_Field] = []
        self.values: list[tuple[_Field, str]] = []  # with the code of `struct`
        self.convert: list[tuple[int, Callable[[bytes], Any]]] = []
        self.filled: list[int] = []
        self.rests: list[tuple[_Field, DataType | None]] = []  # of each metric behind alias and name

    def free(self, field: _Field) -> None:
        """Let a field's content be anything; of a varint, anything of the same number of bytes."""
        if field.wire == _VARINT and field.end - field.start > VARINT_BYTES_MAX:
            raise _UnusualError
        bits = b"\x80" if field.wire == _VARINT else b"\x00"
        self.mask[field.start : field.end] = bits * (field.end - field.start)

    def take_value(self, place: int, field: _Field, datatype: DataType) -> None:
        """Have the metric at `place` take its value from a field."""
        size = field.end - field.start
        code = f"{size}s"
        convert: Callable[[bytes], Any] | None = None
        if field.number == _FLOATING:
            code = "d"
        elif field.number == _SINGLE:
            code = "f"
        elif field.number == _TEXT:
            convert = _text
        elif field.number == _BOOLEAN:
            if size > 1:
                raise _UnusualError
            code = "?"
        elif size == 1:
            code = "B"  # below 128, which is the same in every type
        else:
            convert = _whole_number(field.number, _UNKNOWN[field.number] if datatype is DataType.UNKNOWN else datatype, size)
        if convert is not None:
            self.convert.append((len(self.values), convert))
        self.values.append((field, code))
        self.filled.append(place)
        self.free(field)


def learn(payload: bytes, datatypes: Sequence[DataType], readings: Sequence[Reading], names: tuple[str, ...]) -> Layout | None:
    """Return the layout of a message that gave these readings of metrics of these declared types; None for an unusual one."""
    if len(payload) > LENGTH_MAX:
        return None
    try:
        return _learnt(payload, datatypes, readings, names)
    except _UnusualError:
        return None


def _learnt(payload: bytes, datatypes: Sequence[DataType], readings: Sequence[Reading], names: tuple[str, ...]) -> Layout:
    fields = list(_walk(payload, 0, len(payload)))
    expected = [_TIMESTAMP, *[_METRIC] * len(readings), _SEQ]
    if not readings or [(field.number, field.wire) for field in fields] != expected:
        raise _UnusualError
    first, *metrics, last = fields
    draft = _Draft(payload)
    draft.free(first)
    draft.free(last)
    for place, (metric, datatype) in enumerate(zip(metrics, datatypes, strict=True)):
        _read_metric(draft, place, metric, datatype)
    if draft.stamps and len(draft.stamps) != len(metrics):
        raise _UnusualError
    raws = {payload[stamp.start : stamp.end] for stamp in draft.stamps}
    together = len(raws) == 1
    for stamp in draft.stamps:
        draft.free(stamp)
    bits = int.from_bytes(draft.mask, "little")
    mask, spread, low_bits = bits, 0, 0
    if together:
        spread = sum(1 << 8 * stamp.start for stamp in draft.stamps)
        width = draft.stamps[0].end - draft.stamps[0].start
        mask |= ((1 << 8 * width) - 1) * spread
        low_bits = int.from_bytes(b"\x7f" * width, "little")
    tail = _Field(_SEQ[0], _SEQ[1], metrics[-1].end, len(payload))
    good = all(reading.quality is Quality.GOOD and reading.reason is None for reading in readings)
    has_history = any(reading.is_historical for reading in readings)
    return Layout(
        length=len(payload),
        mask=mask,
        constant=int.from_bytes(payload, "little") & bits,
        spread=spread,
        low_bits=low_bits,
        stamp_end=first.end,
        seq_at=last.start,
        is_seq_short=last.end - last.start == 1,
        first_at=draft.stamps[0].start if together else 0,
        first_end=draft.stamps[0].end if together else 0,
        stamps=None if together or not raws else _struct([(s, f"{s.end - s.start}s") for s in draft.stamps], len(payload)),
        values=_struct(draft.values, len(payload)),
        convert=tuple(draft.convert),
        blank=() if len(draft.filled) == len(metrics) else (None,) * len(metrics),
        filled=() if len(draft.filled) == len(metrics) else tuple(draft.filled),
        names=names or tuple(reading.name for reading in readings),
        units=tuple(reading.unit for reading in readings),
        qualities=repeat(Quality.GOOD) if good else tuple(reading.quality for reading in readings),
        reasons=repeat(None) if good else tuple(reading.reason for reading in readings),
        historical=tuple(reading.is_historical for reading in readings) if has_history else repeat(False),
        has_history=has_history,
        pieces=_pieces(draft, first, tail) if good and len(draft.rests) == len(metrics) else None,
    )


def _read_metric(draft: _Draft, place: int, metric: _Field, datatype: DataType) -> None:
    fields: dict[int, _Field] = {}
    for field in _walk(draft.payload, metric.start, metric.end):
        if _FIELDS.get(field.number) != field.wire or field.number in fields:
            raise _UnusualError
        fields[field.number] = field
    if _STAMP in fields:
        draft.stamps.append(fields[_STAMP])
    if (rest := _rest(draft.payload, metric, fields, datatype)) is not None:
        draft.rests.append(rest)
    values = [field for field in fields.values() if field.number >= _INT]
    if len(values) > 1 or (values and _IS_NULL in fields):
        raise _UnusualError
    if values:
        draft.take_value(place, values[0], datatype)


def _rest(
    payload: bytes, metric: _Field, fields: Mapping[int, _Field], datatype: DataType
) -> tuple[_Field, DataType | None] | None:
    """Return the piece of a metric behind alias and name, and its type where the piece does not say it; None where there is more
    than time stamp, type and value."""
    heads = [field.end for field in fields.values() if field.number in _HEADS]
    rest = [field for field in fields.values() if field.number not in _HEADS]
    told = fields.get(_TYPE)
    if not heads or _STAMP not in fields or datatype is DataType.UNKNOWN or any(field.end < heads[-1] for field in rest):
        return None
    if any(field.number not in (_STAMP, _TYPE) and field.number < _INT for field in rest) or rest[-1].number < _INT:
        return None
    if told is not None and number(payload[told.start : told.end]) != datatype:
        return None
    return _Field(0, _BYTES, heads[-1], metric.end), datatype if told is None else None


def _pieces(draft: _Draft, first: _Field, tail: _Field) -> Pieces:
    places = [first._replace(start=0), *(rest for rest, _ in draft.rests), tail]
    cut = _struct([(place, f"{place.end - place.start}s") for place in places], len(draft.payload))
    return Pieces(cut, tuple(rest.end - rest.start for rest, _ in draft.rests), tuple(told for _, told in draft.rests))


def _walk(data: bytes, at: int, end: int) -> Iterator[_Field]:
    while at < end:
        tag, start = data[at], at + 1
        wire = tag & 7
        if tag > 127 or wire not in (_VARINT, _DOUBLE, _BYTES, _FLOAT):
            raise _UnusualError
        if wire == _VARINT:
            at = _varint_end(data, start, end)
        elif wire == _BYTES:
            inside = _varint_end(data, start, end)
            at = inside + number(data[start:inside])
            start = inside
        else:
            at = start + (8 if wire == _DOUBLE else 4)
        if at > end:
            raise _UnusualError
        yield _Field(tag >> 3, wire, start, at)


def _varint_end(data: bytes, at: int, end: int) -> int:
    for place in range(at, min(at + 10, end)):
        if data[place] < 128:
            return place + 1
    raise _UnusualError


@lru_cache(maxsize=4096)
def _struct_of(code: str) -> Struct:
    return Struct(code)


def _struct(parts: Sequence[tuple[_Field, str]], length: int) -> Struct:
    """Return the struct that takes these fields out of a payload, in the order of the metrics."""
    code, at = "<", 0
    for field, of in parts:
        code += f"{field.start - at}x{of}"
        at = field.end
    return _struct_of(f"{code}{length - at}x")


def _text(raw: bytes) -> str:
    return raw.decode()


@lru_cache(maxsize=1024)
def _whole_number(field: int, datatype: DataType, size: int) -> Callable[[bytes], Any]:
    """Return what reads a varint of `size` bytes as a whole number of its type."""
    field_bits = 32 if field == _INT else 64
    if 7 * size < _BITS[datatype] and 7 * size < field_bits:
        return number
    return partial(_cut, (1 << field_bits) - 1, READ[datatype])


def _cut(mask: int, read: Callable[[Any], Any], raw: bytes) -> Any:
    return read(number(raw) & mask)
