"""The messages of a machine again, in the order in which they came, from wherever their samples lie by now.

They are read in pages of numbers, each page from one state of the store, so that sealing goes on beside a long replay.
"""

import sqlite3
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from functools import partial
from struct import unpack
from typing import NamedTuple

from cnctwin.memory.store import hot
from cnctwin.memory.store.birth_body import unpacked
from cnctwin.memory.store.chunk import Chunk, read_chunks_of_page
from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.intake import DATA_CODE, EVENT_KINDS, HOUR_MS
from cnctwin.memory.store.series_table import HISTORY_BIT, RANK_MASK, RANKS, REASON_SHIFT
from cnctwin.memory.store.value_form import Kind, given
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from twin.vocabulary.nodes import HISTORIAN_NODE

PAGE_FIRST, PAGE_MESSAGES, PAGE_NUMBERS_MAX = 2_000, 4_000, 1_000_000
"""Its holes say that nobody wrote down what came: they concern every machine."""
Parts = dict[int, list[tuple[int, int, Reading]]]
"""The parts of each message, by number: time, series and reading of its samples."""
_Series = Mapping[int, tuple[str, str | None, Kind]]
"""Name, unit and kind, by series."""


class Header(NamedTuple):
    """A DATA message without its readings."""

    received_ms: int
    node: str
    stamp_ms: int
    detail: str
    place: bytes | None


class Sealed(NamedTuple):
    """The sealed hours' part of a page."""

    headers: dict[int, Header]
    parts: Parts


SealedPage = Callable[[sqlite3.Connection, str, int, int], Sealed]
"""(connection, machine, first number, number after the last) → what is sealed of it."""


def messages(
    snapshot: Callable[[], AbstractContextManager[sqlite3.Connection]],
    sealed: SealedPage,
    asked: tuple[str, int, int],
    again: Callable[[Callable[[], list[Message]]], list[Message]],
) -> Iterator[Message]:
    """Yield the messages of a machine with received_ms in [from_ms, to_ms): asked = these three.

    again: repeats what met a file that was removed meanwhile
    """
    machine, from_ms, to_ms = asked

    def page(first: int, until: int) -> list[Message]:
        with snapshot() as db:
            return _page(db, sealed, machine, first, until)

    with snapshot() as db:
        first, end = _numbers(db, machine, from_ms, to_ms)
    step = PAGE_FIRST
    while first < end:
        until = min(first + step, end)
        some = again(partial(page, first, until))
        yield from (message for message in some if from_ms <= message.received_ms < to_ms)
        step = max(PAGE_FIRST // 4, min(step * 2 if len(some) < PAGE_MESSAGES else step // 2, PAGE_NUMBERS_MAX))
        first = until


_RANGE = """
SELECT min(number), max(number) FROM events WHERE machine = ?1 AND received_ms >= ?2 AND received_ms < ?3
UNION ALL
SELECT min(number), max(number) FROM events WHERE machine IS NULL AND received_ms >= ?2 AND received_ms < ?3
UNION ALL
SELECT min(number), max(last_number) FROM chunks INDEXED BY chunks_of_machine
WHERE machine = ?1 AND last_received_ms >= ?2 AND first_received_ms < ?3
UNION ALL
SELECT min(first_number), max(last_number) FROM files WHERE machine = ?1 AND last_received_ms >= ?2 AND first_received_ms < ?3
"""
_EVENTS = """
SELECT number, received_ms, nodes.name, kind, stamp_ms, detail, body, place, from_ms, to_ms
FROM events JOIN nodes ON nodes.id = events.node
WHERE machine = ? AND number >= ? AND number < ?
"""
_HOLES = f"""
SELECT number, received_ms, nodes.name, stamp_ms, detail
FROM nodes JOIN events ON events.machine IS NULL AND events.node = nodes.id
WHERE (nodes.id IN (SELECT node FROM signals WHERE machine = ?) OR nodes.name LIKE '%/{HISTORIAN_NODE}')
    AND number >= ? AND number < ?
"""  # noqa: S608


def _numbers(db: sqlite3.Connection, machine: str, from_ms: int, to_ms: int) -> tuple[int, int]:
    found = db.execute("SELECT id FROM machines WHERE name = ?", (machine,)).fetchone()
    if found is None:
        return 0, 0
    rows = db.execute(_RANGE, (found[0], from_ms, to_ms)).fetchall()
    firsts = [first for first, _ in rows if first is not None]
    return (min(firsts), max(last for _, last in rows if last is not None) + 1) if firsts else (0, 0)


def _page(db: sqlite3.Connection, sealed: SealedPage, machine: str, first: int, until: int) -> list[Message]:
    (number,) = db.execute("SELECT id FROM machines WHERE name = ?", (machine,)).fetchone()
    done: dict[int, Message] = {}
    headers, parts = sealed(db, machine, first, until)
    spans: list[tuple[int, int]] = []
    for row in db.execute(_EVENTS, (number, first, until)):
        of, received_ms, node, kind, stamp_ms, detail, body, place, from_ms, to_ms = row
        if kind == DATA_CODE:
            headers[of] = Header(received_ms, node, stamp_ms, detail or "", place)
            if from_ms is not None:
                spans.append((from_ms, to_ms))
        else:
            readings = () if body is None else unpacked(body)
            done[of] = Message(received_ms, HostEvent(EVENT_KINDS[kind], _node(node), machine, stamp_ms, readings, detail or ""))
    for of, received_ms, node, stamp_ms, detail in db.execute(_HOLES, (number, first, until)):
        done[of] = Message(received_ms, HostEvent(EventKind.HOLE, _node(node), None, stamp_ms, (), detail or ""))
    series = hot.by_sid(db, machine)
    for chunk in read_chunks_of_page(db, number, first, until):
        done.update(told for told in _chunk_messages(db, machine, series, chunk) if first <= told[0] < until)
    if spans:
        _hot_parts(db, series, (first, until), spans, parts)
    for of, header in headers.items():
        done[of] = _data(machine, header, parts.get(of, []))
    return [done[of] for of in sorted(done)]


def _data(machine: str, header: Header, samples: list[tuple[int, int, Reading]]) -> Message:
    samples.sort()  # no two are of one time and series, so that readings are never compared
    readings = [sample[2] for sample in samples]
    if header.place is not None and len(header.place) == 4 * len(readings):
        ordered = list(readings)
        for reading, place in zip(readings, unpack(f"<{len(readings)}I", header.place), strict=True):
            ordered[place] = reading
        readings = ordered
    node = _node(header.node)
    event = HostEvent(EventKind.DATA, node, machine, header.stamp_ms, tuple(readings), header.detail)
    return Message(header.received_ms, event)


def _chunk_messages(db: sqlite3.Connection, machine: str, series: _Series, chunk: Chunk) -> Iterator[tuple[int, Message]]:
    """Yield the messages of a chunk, each behind its number."""
    texts = hot.reasons(db, {flag >> REASON_SHIFT for flag in chunk.flags})
    columns: list[list[Reading]] = []
    new = tuple.__new__
    for place, (sid, flag) in enumerate(zip(chunk.sids, chunk.flags, strict=True)):
        name, unit, _ = series[sid]
        marks = RANKS[flag & RANK_MASK], unit, texts[flag >> REASON_SHIFT], bool(flag & HISTORY_BIT)
        told = zip(chunk.values(place), chunk.stamps(place), strict=True)
        columns.append([new(Reading, (name, value, stamp_ms, *marks)) for value, stamp_ms in told])
    node = _node(chunk.node)
    rows = zip(chunk.numbers(), chunk.received_ms(), chunk.message_stamps(), zip(*columns, strict=True), strict=True)
    for number, received_ms, stamp_ms, readings in rows:
        yield number, Message(received_ms, HostEvent(EventKind.DATA, node, machine, stamp_ms, readings))


def _node(text: str) -> NodeId:
    group, _, node = text.partition("/")
    return NodeId(group, node)


def _stretches(spans: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """The times of a page as few stretches: a message of yesterday beside those of now does not make a day of it."""
    joined: list[list[int]] = []
    for from_ms, to_ms in sorted(spans):
        if joined and from_ms - joined[-1][1] < HOUR_MS // 60:
            joined[-1][1] = max(joined[-1][1], to_ms)
        else:
            joined.append([from_ms, to_ms])
    return [(from_ms, to_ms) for from_ms, to_ms in joined]


def _hot_parts(
    db: sqlite3.Connection, series: _Series, page: tuple[int, int], spans: list[tuple[int, int]], parts: Parts
) -> None:
    asked = "SELECT t, value, flag, number FROM samples WHERE sid = ? AND t >= ? AND t < ? AND number >= ? AND number < ?"
    texts: dict[int, str | None] = {0: None}
    for from_ms, to_ms in _stretches(spans):
        for sid, (name, unit, kind) in series.items():
            rows = db.execute(asked, (sid, from_ms * 1000, to_ms * 1000 + 1000, *page)).fetchall()
            texts |= hot.reasons(db, {row[2] >> REASON_SHIFT for row in rows} - texts.keys())
            for t, value, flag, number in rows:
                quality, is_historical = RANKS[flag & RANK_MASK], bool(flag & HISTORY_BIT)
                reason = texts[flag >> REASON_SHIFT]
                reading = Reading(name, given(kind, value), t // 1000, quality, unit, reason, is_historical)
                parts.setdefault(number, []).append((t, sid, reading))
