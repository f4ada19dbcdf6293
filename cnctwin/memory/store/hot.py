"""Questions to the hot tier: series, last samples, samples of a stretch, windows."""

import math
import sqlite3
from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from cnctwin.memory.store.chunk import ChunkSamples, read_chunks
from cnctwin.memory.store.contract import Sample, Series
from cnctwin.memory.store.series_table import RANK_MASK, RANKS, REASON_SHIFT
from cnctwin.memory.store.value_form import NUMBERS, Kind, given
from cnctwin.memory.store.windows import Numbers, StoredSample, Windows

_VALUES_MAX = 500


class SeriesOf(NamedTuple):
    """One series of a signal that was asked for."""

    sid: int
    unit: str | None
    kind: Kind
    stored_class: int


class SignalSeries(NamedTuple):
    """A signal that was asked for: its series, and the unit it has now."""

    series: tuple[SeriesOf, ...]
    unit: str | None


_SERIES = """
SELECT signals.name, series.sid, series.unit, series.kind, series.class, coalesce(latest.last_us, -1), series.sid = latest.sid
FROM machines JOIN signals ON signals.machine = machines.id JOIN series ON series.signal = signals.id
    LEFT JOIN latest ON latest.signal = signals.id
WHERE machines.name = ?
"""
_LATEST = """
SELECT signals.name, nodes.name, latest.first_us, latest.last_us, latest.value, latest.flag, series.unit, series.kind
FROM machines JOIN signals ON signals.machine = machines.id JOIN nodes ON nodes.id = signals.node
    JOIN latest ON latest.signal = signals.id JOIN series ON series.sid = latest.sid
WHERE machines.name = ? ORDER BY signals.name, nodes.name
"""
_ODD = "SELECT DISTINCT t / ?1 FROM samples WHERE sid = ?2 AND t >= ?3 AND t < ?4 AND flag & 3"
_WINDOWS = """
SELECT t / ?1, count(*), total(value), min(value), max(value) FROM samples WHERE sid = ?2 AND t >= ?3 AND t < ?4 GROUP BY 1
"""
_SAMPLES = "SELECT t, value, flag FROM samples WHERE sid = ? AND t >= ? AND t < ?"
_NO_CHUNKS = ChunkSamples(())


def asked(db: sqlite3.Connection, machine: str, signals: Sequence[str]) -> dict[str, SignalSeries]:
    """The series of each signal, of all nodes that tell it."""
    wanted = set(signals)
    found: dict[str, list[SeriesOf]] = {name: [] for name in signals}
    units: dict[str, tuple[int, str | None]] = {}
    for name, sid, unit, kind, stored_class, last_us, is_last in db.execute(_SERIES, (machine,)):
        if name in wanted:
            found[name].append(SeriesOf(sid, unit, Kind(kind), stored_class))
            if is_last and last_us > units.get(name, (-1, None))[0]:
                units[name] = (last_us, unit)
    return {name: SignalSeries(tuple(series), units.get(name, (0, None))[1]) for name, series in found.items()}


def reasons(db: sqlite3.Connection, numbers: Iterable[int]) -> dict[int, str | None]:
    """The texts of these reasons."""
    wanted = sorted(set(numbers) - {0})
    texts: dict[int, str | None] = {0: None}
    for at in range(0, len(wanted), _VALUES_MAX):
        some = wanted[at : at + _VALUES_MAX]
        texts |= dict(db.execute(f"SELECT id, text FROM reasons WHERE id IN ({','.join('?' * len(some))})", some))  # noqa: S608
    return texts


def chunk_samples(db: sqlite3.Connection, machine: int, from_us: int, to_us: int) -> ChunkSamples:
    """The chunks of a machine in [from_us, to_us), for `told` and `fill`."""
    return ChunkSamples(read_chunks(db, machine, from_us // 1000, -(-to_us // 1000)))


def told(db: sqlite3.Connection, chunks: ChunkSamples, series: SeriesOf, from_us: int, to_us: int) -> list[StoredSample]:
    """The samples of a series in [from_us, to_us)."""
    rows = db.execute(_SAMPLES, (series.sid, from_us, to_us)).fetchall() + chunks.within(series.sid, from_us, to_us)
    return _with_reasons(db, rows, series.kind)


def _with_reasons(db: sqlite3.Connection, rows: Sequence[tuple[int, Any, int]], kind: Kind) -> list[StoredSample]:
    texts = reasons(db, {flag >> REASON_SHIFT for _, _, flag in rows})
    return [
        (t, value if type(value) is float else given(kind, value), flag & RANK_MASK, texts[flag >> REASON_SHIFT])
        for t, value, flag in rows
    ]


def fill(db: sqlite3.Connection, chunks: ChunkSamples, windows: Windows, series: SeriesOf, span_us: tuple[int, int]) -> None:
    """Put the samples of a series into their windows; those that hold nothing but good, finite numbers are summed up at once."""
    from_us, to_us = span_us
    if series.kind not in NUMBERS:
        windows.add(told(db, chunks, series, from_us, to_us))
        return
    _fill_of_chunks(db, chunks, windows, series, span_us)
    every_us = windows.every_us
    values = (every_us, series.sid, from_us, to_us)
    odd = {number for (number,) in db.execute(_ODD, values)}
    for number, count, total, low, high in db.execute(_WINDOWS, values).fetchall():
        # A NaN is a blob, and larger than any number; infinity shows in the sum.
        if number not in odd and type(high) is not bytes and -math.inf < total < math.inf:
            windows.put(number, Numbers(count, count, total, float(low), float(high), number * every_us))
        else:
            windows.add(told(db, _NO_CHUNKS, series, max(from_us, number * every_us), min(to_us, (number + 1) * every_us)))


def _fill_of_chunks(
    db: sqlite3.Connection, chunks: ChunkSamples, windows: Windows, series: SeriesOf, span_us: tuple[int, int]
) -> None:
    from_us, to_us = span_us
    stamps, values, flags = chunks.column(series.sid)
    every_us, at, end = windows.every_us, bisect_left(stamps, -(-from_us // 1000)), bisect_left(stamps, -(-to_us // 1000))
    is_odd = any(flag & RANK_MASK for flag in set(flags))
    while at < end:
        number = stamps[at] * 1000 // every_us
        until = bisect_left(stamps, -(-(number + 1) * every_us // 1000), at, end)
        some = values[at:until]
        total = float(sum(some))
        if math.isfinite(total) and not (is_odd and any(flag & RANK_MASK for flag in flags[at:until])):
            count = until - at
            windows.put(number, Numbers(count, count, total, float(min(some)), float(max(some)), number * every_us))
        else:
            rows = list(zip([ms * 1000 for ms in stamps[at:until]], some, flags[at:until], strict=True))
            windows.add(_with_reasons(db, rows, series.kind))
        at = until


def _last_rows(db: sqlite3.Connection, machine: str) -> list[tuple[Any, ...]]:
    return db.execute(_LATEST, (machine,)).fetchall()


def latest(db: sqlite3.Connection, machine: str) -> dict[str, Sample]:
    """The last sample of each signal; where several nodes tell it, the newest."""
    rows = _last_rows(db, machine)
    texts = reasons(db, {row[5] >> REASON_SHIFT for row in rows})
    found: dict[str, Sample] = {}
    for name, _, _, last_us, value, flag, unit, kind in rows:
        if name not in found or last_us > found[name].t_us:
            value = given(Kind(kind), value)  # noqa: PLW2901
            found[name] = Sample(name, last_us, value, RANKS[flag & RANK_MASK], texts[flag >> REASON_SHIFT], unit)
    return found


def all_series(db: sqlite3.Connection, machine: str) -> list[Series]:
    """The signals of a machine, by name."""
    return [
        Series(machine, node, name, unit, first_us, last_us)
        for name, node, first_us, last_us, _, _, unit, _ in _last_rows(db, machine)
    ]


def by_sid(db: sqlite3.Connection, machine: str) -> Mapping[int, tuple[str, str | None, Kind]]:
    """Name, unit and kind of each series of a machine."""
    return {sid: (name, unit, Kind(kind)) for name, sid, unit, kind, *_ in db.execute(_SERIES, (machine,))}
