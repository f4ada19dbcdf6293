"""The readings of a BIRTH or DEATH beside their samples: compressed JSON, from which each comes back bit for bit."""

import base64
import json
import math
import zlib
from collections.abc import Sequence
from typing import Any

from cnctwin.memory.store.value_form import CannotKeepError, Kind, given, kept
from sparkplug.metric import Reading
from sparkplug.quality import Quality

_PLAIN = (bool, int, str, type(None))


def packed(readings: Sequence[Reading]) -> bytes:
    """The readings as bytes; those that hold a data set or a template are left out."""
    told = []
    for reading in readings:
        name, value, stamp_ms, quality, unit, reason, is_historical = reading
        try:
            told.append([name, _form(value), stamp_ms, int(quality), unit, reason, int(is_historical)])
        except CannotKeepError:
            continue
    return zlib.compress(json.dumps(told, separators=(",", ":")).encode(), 6)


def unpacked(body: bytes) -> tuple[Reading, ...]:
    """The readings again.

    >>> reading = Reading("x", (1.5, 2.0), 7, Quality.GOOD, "mm", None, False)
    >>> unpacked(packed([reading])) == (reading,)
    True
    """
    return tuple(
        Reading(name, _value(value), stamp_ms, Quality(quality), unit, reason, bool(is_historical))
        for name, value, stamp_ms, quality, unit, reason, is_historical in json.loads(zlib.decompress(body))
    )


def _form(value: Any) -> Any:
    if type(value) in _PLAIN or (type(value) is float and math.isfinite(value)):
        return value
    kind, form = kept(value)
    return (
        {"kind": int(kind), "bytes": base64.b64encode(form).decode()}
        if isinstance(form, bytes)
        else {"kind": int(kind), "is": form}
    )


def _value(told: Any) -> Any:
    if not isinstance(told, dict):
        return told
    return given(Kind(told["kind"]), base64.b64decode(told["bytes"]) if "bytes" in told else told["is"])
