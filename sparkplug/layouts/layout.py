"""The byte layout of one kind of data message: which bytes are constant, and where time stamps and values stand.

A message is read as one large number. Under `mask` it must equal the constant bytes; the mask also covers the continuation bits
of every varint, so that a varint of another length does not match. Time stamps that were equal in the message from which the
layout was learnt have to be equal again: `spread` has a one where each begins, so that its product with the first is what all
of them must be. Then one `struct` takes the values out.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import repeat
from struct import Struct
from typing import Any, NamedTuple

from sparkplug.layouts.pieces import Pieces
from sparkplug.layouts.varint import number
from sparkplug.metric import Reading
from sparkplug.quality import Quality

Columns = tuple[int, int, Iterable[Any], Iterable[int], int, int]
"""The time stamp and number of a message, then of its readings values, time stamps, the oldest and the newest of these."""
_READING, _NEW, _number = repeat(Reading), tuple.__new__, int.from_bytes


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """The bytes that are constant in the messages of one layout, and the way to read the rest.

    The time stamps of the metrics: all equal, the first of them at `first_at` (`low_bits` masks its continuation bits away); or
    each for itself, then `stamps` takes them out; or the payload's, then there is neither. `convert` holds the places of values
    that `struct` leaves as bytes. `blank` has a place for each metric and `filled` those that have a value; both are empty where
    all have one. `pieces` is None where a message cannot be handed on in pieces.
    """

    length: int
    mask: int
    constant: int
    spread: int
    low_bits: int
    stamp_end: int
    seq_at: int
    is_seq_short: bool
    first_at: int
    first_end: int
    stamps: Struct | None
    values: Struct
    convert: tuple[tuple[int, Callable[[bytes], Any]], ...]
    blank: tuple[None, ...]
    filled: tuple[int, ...]
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    qualities: Iterable[Quality]
    reasons: Iterable[str | None]
    historical: Iterable[bool]
    has_history: bool
    pieces: Pieces | None

    def columns(self, payload: bytes, whole: int) -> Columns | None:
        """Return what a message says; None where it is of another layout or has to be read the long way.

        `whole` is the payload as a little-endian number.
        """
        constant, raw, first_at = self.constant, b"", self.first_at
        if first_at:
            raw = payload[first_at : self.first_end]
            constant += (_number(raw, "little") & self.low_bits) * self.spread
        if whole & self.mask != constant:
            return None
        own = payload[1 : self.stamp_end]
        stamp_ms = oldest_ms = newest_ms = number(own)
        if self.stamps is not None:
            stamps_ms: Iterable[int] = [*map(number, self.stamps.unpack(payload))]
            oldest_ms, newest_ms = min(stamps_ms), max(stamps_ms)
        else:
            if first_at and raw != own:
                oldest_ms = newest_ms = number(raw)
            stamps_ms = repeat(oldest_ms)
        if not stamp_ms or not oldest_ms:
            return None  # 0 is no time stamp: the host's clock or the payload's time stamp stands in for it
        values: Iterable[Any] = self.values.unpack(payload)
        if self.convert or self.blank:
            try:
                values = self._row(list(values))
            except UnicodeDecodeError:
                return None
        seq = payload[-1] if self.is_seq_short else number(payload[self.seq_at :])
        return stamp_ms, seq, values, stamps_ms, oldest_ms, newest_ms

    def readings(self, values: Iterable[Any], stamps_ms: Iterable[int]) -> tuple[Reading, ...]:
        """Return the readings of a message with these columns."""
        rows = zip(self.names, values, stamps_ms, self.qualities, self.units, self.reasons, self.historical)  # noqa: B905 — slower
        return tuple(map(_NEW, _READING, rows))

    @property
    def size(self) -> int:
        """Roughly how many bytes of memory the layout takes."""
        return 1000 + 5 * self.length + 100 * len(self.names)

    def _row(self, values: list[Any]) -> list[Any]:
        for place, convert in self.convert:
            values[place] = convert(values[place])
        if not self.blank:
            return values
        row: list[Any] = list(self.blank)
        for place, value in zip(self.filled, values, strict=True):
            row[place] = value
        return row


class Packed(NamedTuple):
    """A data message that nobody has taken apart yet: who hands messages on may never have to. Its readings are good, and none is
    historical."""

    layout: Layout
    payload: bytes

    def readings(self) -> tuple[Reading, ...]:
        """Return the readings, equal ones each time."""
        columns = self.layout.columns(self.payload, _number(self.payload, "little"))
        assert columns is not None, "the payload is of its layout"
        return self.layout.readings(columns[2], columns[3])
