"""The state known before a moment: the last sample of each signal, however long ago.

Controls report what changes, so a program or an override that was told an hour before a stretch holds at its start.

A store is asked for the last hour, then for windows of a day, a month and all that is older: dense signals are found at once, and
rare ones are few.
"""

from collections.abc import Iterable
from typing import NamedTuple

from cnctwin.memory.store.contract import Column, Query, Store
from sparkplug.quality import Quality
from sparkplug.values import Value

HOUR_MS, DAY_MS, WEEK_MS = 3_600_000, 86_400_000, 7 * 86_400_000
_STEPS = ((HOUR_MS, None), (DAY_MS, HOUR_MS), (31 * DAY_MS, DAY_MS), (1 << 62, WEEK_MS))
"""The windows, one further back than the other, in which what is older than an hour is looked for."""


class Known(NamedTuple):
    """A value that holds, and when it was told."""

    t_us: int
    value: Value


def known_before(store: Store, machine: str, signals: Iterable[str], at_ms: int) -> dict[str, Known]:
    """Return the last value of each signal before a moment; without those whose last sample was not good. Raises StoreError."""
    wanted = set(signals)
    began: dict[str, int] = {}
    for series in store.series(machine):
        if series.signal in wanted and series.first_us // 1000 < at_ms:
            began[series.signal] = min(series.first_us // 1000, began.get(series.signal, at_ms))
    found: dict[str, Known] = {}
    until_ms = at_ms
    for back_ms, every_ms in _STEPS:
        from_ms = max(at_ms - back_ms, min(began.values(), default=at_ms))
        if from_ms >= until_ms:
            continue
        for column in store.query(Query(machine, tuple(sorted(began)), from_ms, until_ms, every_ms)):
            if not column.t_us:
                continue
            del began[column.signal]
            if every_ms is not None:
                column = _last_window(store, machine, column, every_ms, (from_ms, until_ms))  # noqa: PLW2901
            if column.t_us and column.quality[-1] is Quality.GOOD:
                found[column.signal] = Known(column.t_us[-1], column.value[-1])
        until_ms = from_ms
    return found


def _last_window(store: Store, machine: str, column: Column, every_ms: int, span_ms: tuple[int, int]) -> Column:
    """Return the samples of the last hour in which there are any."""
    while True:
        window_ms = column.t_us[-1] // 1000
        span_ms = max(window_ms, span_ms[0]), min(window_ms + every_ms, span_ms[1])
        finer_ms = {WEEK_MS: DAY_MS, DAY_MS: HOUR_MS}.get(every_ms)
        (column,) = store.query(Query(machine, (column.signal,), *span_ms, finer_ms))
        if finer_ms is None or not column.t_us:
            return column
        every_ms = finer_ms
