"""Samples and windows of several series as the columns of an answer."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from cnctwin.memory.store.contract import Column, Query, Series
from cnctwin.memory.store.influx.sample_row import CODE, Plain, SampleRow
from sparkplug.quality import Quality


@dataclass(frozen=True, slots=True)
class Window:
    """A server's answer for one window of a signal; `worst` is a code of quality, `count` counts all samples."""

    t_us: int
    mean: float | None
    low: float | None
    high: float | None
    count: int
    last: bool | str | None
    worst: float
    reason: str | None


@dataclass(frozen=True, slots=True)
class Answered:
    """A server's answer to a question: samples, or windows, of a signal each, and units as they stand now."""

    rows: dict[str, list[SampleRow]]
    windows: dict[str, list[Window]]
    units: dict[str, str | None]


def columns(query: Query, answered: Answered) -> list[Column]:
    """The columns of a question, in its order."""
    if query.every_ms is None:
        return [_raw(signal, answered.units.get(signal), answered.rows.get(signal, ())) for signal in query.signals]
    return [_windowed(signal, answered.units.get(signal), answered.windows.get(signal, ())) for signal in query.signals]


def _raw(signal: str, unit: str | None, rows: Iterable[SampleRow]) -> Column:
    # The same sample may come twice: with another unit, from the pinned bucket, or sent again to a server that keeps both.
    once = {(row.t_us, row.key.node, str(row.value), row.quality): row for row in rows}
    kept = sorted(once.values(), key=lambda row: (row.t_us, row.key.node))
    return Column(
        signal,
        unit,
        [row.t_us for row in kept],
        [row.value for row in kept],
        [row.quality for row in kept],
        [row.reason for row in kept],
        [],
        [],
        [],
    )


def _windowed(signal: str, unit: str | None, windows: Iterable[Window]) -> Column:
    # Of one window that two buckets tell, the one with more samples is the whole one.
    best: dict[int, Window] = {}
    for window in windows:
        if window.t_us not in best or window.count > best[window.t_us].count:
            best[window.t_us] = window
    kept = [best[t_us] for t_us in sorted(best)]
    numbers = [window.last is None for window in kept]
    return Column(
        signal,
        unit,
        [window.t_us for window in kept],
        [window.mean if window.last is None else window.last for window in kept],
        [_quality(window.worst) for window in kept],
        [window.reason for window in kept],
        [window.low if is_number else None for window, is_number in zip(kept, numbers, strict=True)],
        [window.high if is_number else None for window, is_number in zip(kept, numbers, strict=True)],
        [window.count for window in kept],
    )


def _quality(code: float) -> Quality:
    return next(quality for quality, known in CODE.items() if known == code)


def folded(rows: Sequence[SampleRow], every_ms: int) -> list[Window]:
    """Windows of samples (of one signal, of any order)."""
    by_window: dict[int, list[SampleRow]] = {}
    for row in sorted({(r.t_us, r.key.node, str(r.value), r.quality): r for r in rows}.values(), key=lambda row: row.t_us):
        by_window.setdefault(row.t_us // (every_ms * 1000) * every_ms * 1000, []).append(row)
    return [_window(t_us, held) for t_us, held in by_window.items()]


def _window(t_us: int, rows: Sequence[SampleRow]) -> Window:
    good = [row.value for row in rows if row.quality is Quality.GOOD and isinstance(row.value, float)]
    others: list[Plain] = [row.value for row in rows if isinstance(row.value, bool | str)]
    last = others[-1] if others else None
    worst = max(CODE[row.quality] for row in rows)
    reasons = [row.reason for row in rows if CODE[row.quality] == worst and row.reason is not None]
    return Window(
        t_us,
        sum(good) / len(good) if good else None,
        min(good, default=None),
        max(good, default=None),
        len(rows),
        last if isinstance(last, bool | str) else None,
        worst,
        reasons[-1] if reasons else None,
    )


def newest_series(found: Iterable[Series]) -> list[Series]:
    """One for each node and signal, by signal: from the first to the last of all its units, with the newest one."""
    merged: dict[tuple[str, str], Series] = {}
    for series in found:
        known = merged.get((series.signal, series.node))
        if known is None:
            merged[series.signal, series.node] = series
            continue
        newer = series if series.last_us >= known.last_us else known
        first_us = min(series.first_us, known.first_us)
        merged[series.signal, series.node] = newer._replace(first_us=first_us, last_us=max(series.last_us, known.last_us))
    return [merged[place] for place in sorted(merged)]
