"""When the database is lost, the sealed hours are not: each file says what is in it, and a new manifest is made of them.

Of several files of one stretch the one with the highest number holds all that the others do. The series keep their numbers.
"""

import json
import logging
import sqlite3
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from cnctwin.memory.store.sealed.manifest import FOLDERS, State
from cnctwin.memory.store.sealed.rows import METADATA, read_rows, sid_and_ending
from cnctwin.memory.store.series_table import StoredClass, class_of
from cnctwin.memory.store.value_form import Kind, given, kept

_log = logging.getLogger(__name__)


class SealedFile(NamedTuple):
    """A file and what it says of itself."""

    path: Path
    name: str
    number: int
    about: dict[str, Any]


def adopt(db: sqlite3.Connection, folder: Path) -> int:
    """Name all sealed files of a folder in an empty database, within a transaction; how many there are."""
    newest: dict[tuple[int, str, int], SealedFile] = {}
    highest = 0
    for found in _all(folder):
        highest = max(highest, found.number)
        key = (found.about["class"], found.about["machine"], found.about["from_ms"])
        if key not in newest or found.number > newest[key].number:
            newest[key] = found
    taken = 0
    for found in sorted(newest.values(), key=lambda one: one.number):
        try:
            _take(db, found)
            taken += 1
        except (OSError, pa.ArrowException, KeyError, ValueError) as error:
            _log.warning("%s: cannot be read (%s); it is left as it is", found.path, str(error).splitlines()[0])
    if highest:
        db.execute("UPDATE sqlite_sequence SET seq = max(seq, ?) WHERE name = 'files'", (highest,))
        db.execute("UPDATE meta SET value = (SELECT coalesce(max(last_number), 0) FROM files) WHERE name = 'number'")
        db.execute("UPDATE meta SET value = (SELECT coalesce(sum(samples), 0) FROM files) WHERE name = 'samples'")
    return taken


def _all(folder: Path) -> Iterator[SealedFile]:
    for place in FOLDERS.values():
        for path in sorted((folder / place).rglob("*.parquet")):
            try:
                about = json.loads(pq.read_metadata(path).metadata[METADATA])
                yield SealedFile(path, str(path.relative_to(folder)), int(path.name.split(".")[1]), about)
            except (OSError, pa.ArrowException, KeyError, TypeError, ValueError, IndexError) as error:
                _log.warning("%s: cannot be read (%s); it is left out", path, str(error).splitlines()[0])
                path.rename(path.with_name(path.name + ".damaged"))


def _take(db: sqlite3.Connection, found: SealedFile) -> None:
    about, body = found.about, found.path.read_bytes()
    machine = _number(db, "machines", "name", about["machine"])
    sids = {int(sid): told for sid, told in about["series"].items()}
    for sid, (node, signal, unit, kind) in sids.items():
        _series(db, machine, sid, (node, signal, unit, Kind(kind)))
    columns: dict[str, Any] = {"endings": {}, "nulls": [sid for sid, told in sids.items() if told[3] == Kind.NULL], "odd": False}
    figures = (0, 0, 0, 0, 0)
    if about["class"] != StoredClass.ROLLUP:
        table = pq.read_table(pa.BufferReader(body))
        for text in table["reason"].unique().to_pylist():
            if text is not None:
                _number(db, "reasons", "text", text)
        series = [name for name in table.column_names if name[0] == "s" and name[1].isdigit()]
        columns["endings"] = dict(map(sid_and_ending, series))
        columns["odd"] = bool(columns["nulls"]) or bool(pc.any(pc.not_equal(table["quality"], 0)).as_py())
        nulls = int(pc.sum(pc.list_value_length(table["nulls"])).as_py() or 0)
        samples = nulls + sum(len(table) - table[name].null_count for name in series)
        first, last = pc.min_max(table["n"]).as_py().values()
        figures = (samples, first, last, *pc.min_max(table["received"]).as_py().values())
        _latest(db, table, {sid: Kind(told[3]) for sid, told in sids.items()})
    db.execute(
        "INSERT INTO files VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        (found.number, about["class"], machine, about["from_ms"], about["to_ms"], found.name, int(State.SEALED), len(body),
         zlib.crc32(body), *figures, json.dumps(columns)),
    )  # fmt: skip


def _number(db: sqlite3.Connection, table: str, column: str, text: str) -> int:
    db.execute(f"INSERT OR IGNORE INTO {table}({column}) VALUES (?)", (text,))  # noqa: S608
    return int(db.execute(f"SELECT id FROM {table} WHERE {column} = ?", (text,)).fetchone()[0])  # noqa: S608


def _series(db: sqlite3.Connection, machine: int, sid: int, told: tuple[str, str, str | None, Kind]) -> None:
    node, name, unit, kind = told
    of = (machine, _number(db, "nodes", "name", node), name)
    db.execute("INSERT OR IGNORE INTO signals(machine, node, name) VALUES (?, ?, ?)", of)
    (signal,) = db.execute("SELECT id FROM signals WHERE machine = ? AND node = ? AND name = ?", of).fetchone()
    row = (sid, signal, unit, int(kind), int(class_of(name, kind)))
    db.execute("INSERT OR IGNORE INTO series VALUES (?, ?, ?, ?, ?)", row)


def _latest(db: sqlite3.Connection, table: Any, kinds: dict[int, Kind]) -> None:
    """The last samples, so far as these files know them."""
    reasons: dict[str | None, int] = {None: 0, **dict(db.execute("SELECT text, id FROM reasons"))}
    for sid, part in read_rows(table, kinds, reasons).parts.items():
        last = int(part.t.argmax())
        (signal,) = db.execute("SELECT signal FROM series WHERE sid = ?", (sid,)).fetchone()
        known = db.execute("SELECT first_us, last_us FROM latest WHERE signal = ?", (signal,)).fetchone()
        first_us, last_us = int(part.t.min()), int(part.t[last])
        if known is None or last_us > known[1]:
            first_us = first_us if known is None else min(first_us, known[0])
            row = (signal, sid, first_us, last_us, kept(given(part.kind, part.forms[last]))[1], int(part.flags[last]))
            db.execute("INSERT OR REPLACE INTO latest VALUES (?, ?, ?, ?, ?, ?)", row)
        elif first_us < known[0]:
            db.execute("UPDATE latest SET first_us = ? WHERE signal = ?", (first_us, signal))
