"""A reading as JSON: `{"value", "t", "unit", "quality", "reason"?, "provenance", "meaning"?}`.

What JSON or a page cannot hold (arrays of samples, tables, files, NaN) is null with a reason.
"""

import math
from typing import Any

from sparkplug.metric import Reading
from sparkplug.quality import Quality
from sparkplug.values import Value

QUALITY_NAMES: dict[int, str] = {Quality.GOOD: "good", Quality.STALE: "stale", Quality.BAD: "bad"}
TEXT_MAX = 4000
_PLAIN = frozenset({bool, int, type(None)})
Plain = bool | int | float | str | None


def plain(value: Value) -> tuple[Plain, str | None]:
    """A value as JSON has it; else None with the reason.

    >>> plain(37.5), plain(float("nan")), plain((1.0, 2.0))
    ((37.5, None), (None, 'no finite number'), (None, 'an array of 2 values is not shown'))
    """
    kind = value.__class__
    if kind is float:
        return (value, None) if math.isfinite(value) else (None, "no finite number")  # type: ignore[arg-type,return-value]
    if kind in _PLAIN:
        return value, None  # type: ignore[return-value]
    if isinstance(value, str):
        return value[:TEXT_MAX], None
    if isinstance(value, tuple):
        return None, f"an array of {len(value)} values is not shown"
    return None, f"a value of type {kind.__name__} is not shown"


def value_object(reading: Reading, provenance: str, meaning: str | None = None) -> dict[str, Any]:
    """A reading as the interface gives it."""
    value, trouble = plain(reading.value)
    said: dict[str, Any] = {
        "value": value,
        "t": reading.timestamp_ms,
        "unit": reading.unit,
        "quality": "bad" if trouble else QUALITY_NAMES.get(reading.quality, "bad"),
        "provenance": provenance,
    }
    if reason := trouble or reading.reason:
        said["reason"] = reason
    if meaning:
        said["meaning"] = meaning
    return said
