"""The series, and the last sample of each signal: what the writer has in memory, and in the same transaction on disk.

A signal is what one node tells of one machine under one name. It has a series for each unit and kind of value that came, so that
a series is of one type, and one for its nulls.
"""

import sqlite3
from collections.abc import Iterable
from enum import IntEnum
from math import isfinite
from typing import Any

from cnctwin.memory.store.database import insert
from cnctwin.memory.store.value_form import BLOCKS, Kept, Kind, given, kept
from sparkplug.metric import NodeId
from sparkplug.quality import Quality
from sparkplug.values import Value
from twin.vocabulary.twin_signals import TWIN_PREFIX

RANKS = (Quality.GOOD, Quality.STALE, Quality.BAD)
RANK = {quality: rank for rank, quality in enumerate(RANKS)}
"""Ranks of quality: the worst is the largest."""
RANK_MASK, HISTORY_BIT, REASON_SHIFT = 3, 4, 3
"""A flag is rank + 4 where it came as history + 8 times the number of its reason (0 = none)."""


class StoredClass(IntEnum):
    """A class of series that are kept together, and as long."""

    RAW = 0
    BLOCK = 1
    TWIN = 2
    ROLLUP = 3


def class_of(signal: str, kind: Kind) -> StoredClass:
    """Return the class that a series belongs to."""
    if signal.startswith(TWIN_PREFIX):
        return StoredClass.TWIN
    return StoredClass.BLOCK if kind in BLOCKS else StoredClass.RAW


class Signal:
    """A signal, its series by unit and kind, and its last sample; `last_us` -1 = none yet."""

    __slots__ = ("first_us", "id", "last", "last_flag", "last_ms", "last_sid", "last_us", "machine", "name", "sids")

    def __init__(self, identity: int, machine: int, name: str) -> None:
        self.id, self.machine, self.name = identity, machine, name
        self.sids: dict[tuple[str | None, Kind], int] = {}
        self.last: Value = None
        self.last_flag, self.last_sid = 0, 0
        self.first_us = self.last_us = self.last_ms = -1


class Source:
    """A machine as one node tells it: its signals by name, and how its messages look.

    newest_ms: no sample of its signals is newer; layouts: for `ChunkWriter`, as are the last messages that no signal knows of yet
    """

    __slots__ = ("last_layout", "layouts", "machine", "newest_ms", "node", "signals", "unsettled")

    def __init__(self, machine: int, node: int) -> None:
        self.machine, self.node = machine, node
        self.signals: dict[str, Signal] = {}
        self.newest_ms = -1
        self.layouts: dict[Any, Any] = {}
        self.last_layout: Any = None
        self.unsettled: dict[Any, tuple[Any, ...]] = {}


class SeriesTable:
    """All signals. New ones are written at once, in the transaction that is under way; `load` forgets what was not committed."""

    def __init__(self, db: sqlite3.Connection) -> None:
        self._db = db
        self.load()

    def load(self) -> None:
        """As it is on disk."""
        ask = self._db.execute
        self.machines: dict[str, int] = dict(ask("SELECT name, id FROM machines"))
        self.nodes: dict[str, int] = dict(ask("SELECT name, id FROM nodes"))
        self.reasons: dict[str | None, int] = {None: 0, **dict(ask("SELECT text, id FROM reasons"))}
        self._of: dict[tuple[int, int], Source] = {}
        self._named: dict[tuple[NodeId, str], Source] = {}
        by_id: dict[int, tuple[Signal, Source]] = {}
        for identity, machine, node, name in ask("SELECT id, machine, node, name FROM signals"):
            source = self._source(machine, node)
            signal = source.signals[name] = Signal(identity, machine, name)
            by_id[identity] = signal, source
        self.kinds = kinds = dict[int, Kind]()
        for sid, of, unit, kind in ask("SELECT sid, signal, unit, kind FROM series"):
            kinds[sid] = Kind(kind)
            by_id[of][0].sids[unit, kinds[sid]] = sid
        for identity, sid, first_us, last_us, value, flag in ask(
            "SELECT signal, sid, first_us, last_us, value, flag FROM latest"
        ):
            signal, source = by_id[identity]
            source.newest_ms = max(source.newest_ms, last_us // 1000)
            signal.first_us, signal.last_us, signal.last_ms = first_us, last_us, last_us // 1000
            signal.last, signal.last_sid, signal.last_flag = given(kinds[sid], value), sid, flag

    def machine(self, name: str) -> int:
        """The number of a machine."""
        return self._number(self.machines, "machines(name)", name)

    def node(self, name: str) -> int:
        """The number of a node."""
        return self._number(self.nodes, "nodes(name)", name)

    def reason(self, text: str) -> int:
        """The number of a reason."""
        return self._number(self.reasons, "reasons(text)", text)

    def _number(self, known: dict[Any, int], column: str, text: str) -> int:
        number = known.get(text)
        if number is None:
            number = known[text] = int(self._db.execute(f"INSERT INTO {column} VALUES (?)", (text,)).lastrowid or 0)  # noqa: S608
        return number

    def source(self, node: NodeId, machine: str) -> Source:
        """Return what is known of a machine from a node."""
        key = (node, machine)
        found = self._named.get(key)
        if found is None:
            found = self._named[key] = self._source(self.machine(machine), self.node(str(node)))
        return found

    def _source(self, machine: int, node: int) -> Source:
        found = self._of.get((machine, node))
        if found is None:
            found = self._of[machine, node] = Source(machine, node)
        return found

    def signal(self, source: Source, name: str) -> Signal:
        """A signal that nobody told before."""
        told = (source.machine, source.node, name)
        done = self._db.execute("INSERT INTO signals(machine, node, name) VALUES (?, ?, ?)", told)
        made = source.signals[name] = Signal(int(done.lastrowid or 0), source.machine, name)
        return made

    def series(self, signal: Signal, unit: str | None, kind: Kind) -> int:
        """The series of a signal for a unit and kind."""
        sid = signal.sids.get((unit, kind))
        if sid is None:
            columns = "INSERT INTO series(signal, unit, kind, class) VALUES (?, ?, ?, ?)"
            done = self._db.execute(columns, (signal.id, unit, int(kind), int(class_of(signal.name, kind))))
            sid = signal.sids[unit, kind] = int(done.lastrowid or 0)
            self.kinds[sid] = kind
        return sid

    def keep_latest(self, signals: Iterable[Signal]) -> None:
        """Write the last samples."""
        rows: list[tuple[int, int, int, int, Kept, int]] = []
        for s in signals:
            value = s.last
            form = value if type(value) is float and isfinite(value) else kept(value)[1]
            rows.append((s.id, s.last_sid, s.first_us, s.last_us, form, s.last_flag))
        insert(self._db, "INSERT OR REPLACE INTO latest VALUES", rows)
