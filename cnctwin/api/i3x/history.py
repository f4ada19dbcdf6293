"""The past of signals as i3X has it: values as they came, oldest first, from the store, or of the last minutes from memory.

i3X knows no windows, and the answer is one body. So a question is read in stretches from its beginning until there are
`VALUES_MAX` values of a signal; what is left out is said, and the client asks on from the last value.
"""

import re
from collections.abc import Sequence
from datetime import datetime
from typing import NamedTuple

from cnctwin.api.errors import ApiError
from cnctwin.api.i3x.types import type_of
from cnctwin.api.i3x.vqt import NO_DATA, Vqt, rfc3339, vqt
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.live.stamp import is_time
from cnctwin.api.store_reader import StoreReader
from cnctwin.api.value_object import QUALITY_NAMES, plain
from cnctwin.memory.store.contract import Query, Store, StoreError

VALUES_MAX = 10_000  # of one signal
SIGNALS_MAX = 60  # of one question
RANGE_MS_MAX = 31 * 86_400_000
STRETCH_MS, STRETCH_MS_MAX = 3_600_000, 86_400_000
FEW = VALUES_MAX // 10
"""A stretch that gives fewer values than this is followed by one of twice the length."""
_UTC = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,9})?Z")


class Range(NamedTuple):
    """A range of time, both ends included."""

    start_ms: int
    end_ms: int


class Past(NamedTuple):
    """The values of a signal; `left_out` says why these are not all that there are."""

    values: tuple[Vqt, ...]
    left_out: str | None = None


def range_of(start: str, end: str) -> Range:
    """Return the range between two times as i3X writes them. Raises ApiError.

    >>> range_of("2022-02-10T13:51:02Z", "2022-02-10T13:51:02.250Z")
    Range(start_ms=1644501062000, end_ms=1644501062250)
    """
    asked = Range(_ms("startTime", start), _ms("endTime", end))
    if asked.end_ms < asked.start_ms:
        raise ApiError(400, f"endTime {end} is before startTime {start}")
    if asked.end_ms - asked.start_ms > RANGE_MS_MAX:
        raise ApiError(
            400, f"startTime {start} to endTime {end} is more than 31 days, which is the limit; ask for less at a time"
        )
    return asked


def no_values(asked: Range) -> tuple[Vqt, ...]:
    """Return the one value that says that there is none in the range."""
    return (Vqt(None, NO_DATA, asked.end_ms),)


async def pasts(live: LivePlant, store: StoreReader, machine: str, names: Sequence[str], asked: Range) -> dict[str, Past]:
    """Return the past of some signals of a machine. Raises ApiError where too many questions wait, or one takes too long."""
    if live.remembers(machine, names, asked.start_ms):
        return await store.work(lambda: _from_memory(live, machine, names, asked, None))
    try:
        return await store.ask(lambda opened: {name: _from_store(opened, machine, name, asked) for name in names})
    except (ApiError, StoreError) as error:
        if store.configured:
            raise
        reason = f"only the last minutes are kept: {error}"
    return await store.work(lambda: _from_memory(live, machine, names, asked, reason))


def _from_memory(live: LivePlant, machine: str, names: Sequence[str], asked: Range, reason: str | None) -> dict[str, Past]:
    known = live.recent(machine, names, asked.start_ms, asked.end_ms + 1)
    return {
        name: Past(
            tuple(
                vqt(one.value, QUALITY_NAMES.get(one.quality, "bad"), one.t_ms, type_of(name))
                for one in known.get(name, (None, []))[1]
            ),
            reason,
        )
        for name in names
    }


def _from_store(store: Store, machine: str, name: str, asked: Range) -> Past:
    of, values = type_of(name), list[Vqt]()
    from_ms, stretch_ms = asked.start_ms, STRETCH_MS
    while from_ms <= asked.end_ms:
        to_ms = min(from_ms + stretch_ms, asked.end_ms + 1)
        (column,) = store.query(Query(machine, (name,), from_ms, to_ms))
        told = zip(column.t_us, column.value, column.quality, strict=True)
        values += (vqt(plain(value)[0], QUALITY_NAMES.get(quality, "bad"), t_us // 1000, of) for t_us, value, quality in told)
        if len(values) >= VALUES_MAX and (len(values) > VALUES_MAX or to_ms <= asked.end_ms):
            last = rfc3339(values[VALUES_MAX - 1].t_ms)
            return Past(tuple(values[:VALUES_MAX]), f"{VALUES_MAX} values are the limit; go on with startTime {last}")
        stretch_ms = min(stretch_ms * 2, STRETCH_MS_MAX) if len(column.t_us) < FEW else STRETCH_MS
        from_ms = to_ms
    return Past(tuple(values))


def _ms(name: str, text: str) -> int:
    try:
        if not _UTC.fullmatch(text):
            raise ValueError(text)
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise ApiError(400, f"{name} is {text[:60]!r}; give a time in UTC as in 2026-01-29T16:00:00Z") from None
    stamp_ms = round(moment.timestamp() * 1000)
    if not is_time(stamp_ms):
        raise ApiError(400, f"{name} is {text}; give a time between 1970 and the year 3000")
    return stamp_ms
