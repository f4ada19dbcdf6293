"""The values of OPC UA as plain values: one DataValue, one fact.

A value whose status is not good is a fault with the status' name. Uncertain counts as not good: such a value may be an old one,
and what reads it would not know. The overflow bit (part 4, 7.39.1) says that values before this one were discarded.
"""

import math
from collections.abc import Sequence
from datetime import UTC, datetime

from asyncua import ua

from edge.reading import shortest_of_float32
from edge.sweep import Fact, Plain

TEXT_LENGTH_MAX = 8192
_OVERFLOW = 0x0480  # info type DataValue, and the overflow bit
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def as_fact(key: str, value: ua.DataValue, *, element: int | None = None, stamps: str = "source") -> Fact:
    """This value under this key. `element`: which of an array; `stamps`: source or server, the other where it is missing."""
    first, second = value.SourceTimestamp, value.ServerTimestamp
    if stamps == "server":
        first, second = second, first
    at_ms = stamp_ms(first)
    at_ms = stamp_ms(second) if at_ms is None else at_ms
    status = value.StatusCode if isinstance(value.StatusCode, ua.StatusCode) else ua.StatusCode()
    if not status.is_good():
        return Fact(key, fault=status_name(status), t_ms=at_ms)
    plain, fault = _plain(None if value.Value is None else value.Value.Value, element)
    if isinstance(plain, float) and value.Value is not None and value.Value.VariantType is ua.VariantType.Float:
        plain = shortest_of_float32(plain)
    return Fact(key, plain, fault, at_ms)


def overflowed(value: ua.DataValue) -> bool:
    """Return whether the server's queue ran over before this value."""
    status = value.StatusCode
    return isinstance(status, ua.StatusCode) and int(status.value) & _OVERFLOW == _OVERFLOW


def stamps_apart_ms(value: ua.DataValue) -> int | None:
    """Return how far the source's stamp is from the server's; None where one is missing."""
    source, server = stamp_ms(value.SourceTimestamp), stamp_ms(value.ServerTimestamp)
    return None if source is None or server is None else abs(server - source)


def status_name(status: ua.StatusCode) -> str:
    """The standard's name of a status; its severity and number where it has none."""
    code = int(status.value) & 0xFFFF0000
    name: str = ua.status_codes.get_name_and_doc(code)[0]
    return f"{name} 0x{code:08X}" if name in ("Bad", "Uncertain", "Good") else name


def stamp_ms(stamp: object) -> int | None:
    """Milliseconds since 1970; None for no stamp, and for those from before 1970 that stand for none.

    >>> stamp_ms(datetime(1970, 1, 1, 0, 0, 1))
    1000
    """
    if not isinstance(stamp, datetime):
        return None
    since = (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)) - _EPOCH
    milliseconds = since.days * 86_400_000 + since.seconds * 1000 + since.microseconds // 1000
    return milliseconds if milliseconds > 0 else None


def _plain(value: object, element: int | None) -> tuple[Plain, str]:
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        if element is None and len(value) != 1:
            return None, f"an array of {len(value)} values, of which none is named"
        index = element or 0
        if index >= len(value):
            return None, f"an array of {len(value)} values has no element {index}"
        value = value[index]
    if isinstance(value, ua.LocalizedText):
        value = value.Text or ""
    if isinstance(value, bool) or value is None:
        return (value, "") if value is not None else (None, "no value")
    if isinstance(value, int):
        return int(value), ""
    if isinstance(value, float):
        return (value, "") if math.isfinite(value) else (None, f"not a finite number: {value}")
    if isinstance(value, str):
        return (str(value), "") if len(value) <= TEXT_LENGTH_MAX else (None, f"text of {len(value)} characters")
    return None, f"{type(value).__name__} is no plain value"
