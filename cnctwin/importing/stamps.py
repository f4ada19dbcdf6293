"""The times of a recording from elsewhere, as nanoseconds: numbers with a unit, stamps as ISO 8601, stamps in a format."""

import re
from datetime import UTC, datetime
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from cnctwin.importing.column_map import ISO_8601
from cnctwin.importing.units import conversion
from cnctwin.importing.values import Tally, read_numbers

EPOCH_S = 3e8
"""A number of seconds above this counts from 1970, below it from the start of the measurement."""
NS = 1_000_000_000
UNREADABLE = "rows whose time cannot be read"
_ISO = re.compile(r"(\d{4}-\d\d-\d\d[T ]\d\d:\d\d(?::\d\d)?)(?:[.,](\d+))?\s*(Z|[+-]\d\d:?\d\d)?$")


class Stamps(NamedTuple):
    """Nanoseconds of some rows, which of them could be read, and whether they count from 1970."""

    t_ns: NDArray[np.int64]
    known: NDArray[np.bool_]
    is_absolute: bool


def stamps(told: pa.Array, unit: str, form: str | None, decimal: str, tally: Tally) -> Stamps:
    """Return the times of some rows. unit: of numbers; form: of texts, `ISO 8601` or as strptime takes it."""
    if pa.types.is_timestamp(told.type):
        known = ~np.asarray(pc.is_null(told).to_numpy(zero_copy_only=False), dtype=bool)
        t_ns = pc.fill_null(pc.cast(pc.cast(told, pa.timestamp("ns", told.type.tz), safe=False), pa.int64()), 0)
        return Stamps(np.array(t_ns.to_numpy(zero_copy_only=False), dtype=np.int64), known, True)
    if form is not None:
        return _texts(told, form, tally)
    size = conversion(unit or "s", "s")
    assert size is not None, "the map and the dialects name units of time"
    numbers = read_numbers(told, decimal, (), tally) * size.scale
    known = np.isfinite(numbers) & (np.abs(numbers) < 9e9)
    is_absolute = bool(known.any()) and float(np.max(numbers[known])) > EPOCH_S
    digits = 6 if is_absolute else 9  # what a float of seconds since 1970 holds
    whole = np.where(known, numbers, 0.0)
    return Stamps(np.round(np.round(whole, digits) * NS).astype(np.int64), known, is_absolute)


def _texts(told: pa.Array, form: str, tally: Tally) -> Stamps:
    t_ns = np.zeros(len(told), dtype=np.int64)
    known = np.zeros(len(told), dtype=bool)
    read = iso_ns if form == ISO_8601 else lambda text: _format_ns(text, form)
    for at, text in enumerate(told.to_pylist()):
        if text is None:
            continue
        found = read(str(text).strip())
        if found is not None:
            t_ns[at], known[at] = found, True
        elif not tally.example:
            tally.example = str(text)
    return Stamps(t_ns, known, True)


def iso_ns(text: str) -> int | None:
    """Return nanoseconds since 1970 of a stamp, with any number of digits; without a zone it is UTC. None where it is none.

    >>> iso_ns("1970-01-01T00:00:01.5000001Z"), iso_ns("1970-01-01 01:00:00,25+01:00"), iso_ns("yesterday")
    (1500000100, 250000000, None)
    """
    match = _ISO.match(text)
    if match is None:
        return None
    whole_s = _seconds(match[1], match[3] or "Z")
    return None if whole_s is None else whole_s * NS + int((match[2] or "0")[:9].ljust(9, "0"))


@lru_cache(maxsize=4096)
def _seconds(text: str, zone: str) -> int | None:
    try:
        return int(datetime.fromisoformat(text + zone.replace("Z", "+00:00")).timestamp())
    except ValueError:
        return None


def _format_ns(text: str, form: str) -> int | None:
    try:
        moment = datetime.strptime(text, form)  # noqa: DTZ007  the zone follows below
    except ValueError:
        return None
    moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return int(moment.replace(microsecond=0).timestamp()) * NS + moment.microsecond * 1000
