"""The manifest of sealed files: `<class>/machine=<name>/day=<day>/<from>-<to>.<number>.parquet` below the store.

A file is written under another name, forced to the disk, renamed, and counts from the moment in which the manifest names it,
which is the transaction in which its samples leave the hot tier. What is not named is left over from a kill, and removed.
"""

import hashlib
import json
import os
import sqlite3
import threading
import zlib
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from enum import IntEnum
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from cnctwin.files.synced import make_folder, sync
from cnctwin.memory.store.contract import StoreError
from cnctwin.memory.store.series_table import StoredClass

DAY_MS, HOUR_MS = 86_400_000, 3_600_000
FOLDERS = {
    StoredClass.RAW: "cnc_raw",
    StoredClass.BLOCK: "cnc_raw_blocks",
    StoredClass.TWIN: "cnc_twin_state",
    StoredClass.ROLLUP: "rollup_1min",
}
_NAME_MAX = 180


class State(IntEnum):
    """The state of a file."""

    SEALED = 0
    SWEPT = 1  # past its time; late history for it is refused
    DAMAGED = 2  # set aside


class File(NamedTuple):
    """A row of the manifest."""

    id: int
    stored_class: int
    machine: int
    from_ms: int
    to_ms: int
    name: str
    state: int
    bytes: int
    crc: int
    samples: int
    first_number: int
    last_number: int
    first_received_ms: int
    last_received_ms: int
    columns: str

    @property
    def endings(self) -> Mapping[int, str]:
        """The way each series is kept."""
        return _columns(self.columns)[0]

    @property
    def nulls(self) -> Sequence[int]:
        """The series that have nulls in it."""
        return _columns(self.columns)[1]

    @property
    def is_odd(self) -> bool:
        """True if anything in it is not good."""
        return _columns(self.columns)[2]


@lru_cache(maxsize=1024)
def _columns(text: str) -> tuple[Mapping[int, str], Sequence[int], bool]:
    told = json.loads(text)
    return {int(sid): ending for sid, ending in told["endings"].items()}, tuple(told["nulls"]), bool(told["odd"])


def files(db: sqlite3.Connection, machine: int, from_ms: int, to_ms: int) -> list[File]:
    """The files of a machine that overlap a stretch, in order of time."""
    # None is longer than a day, which lets the index say where to begin.
    asked = "SELECT * FROM files WHERE machine = ? AND from_ms > ? AND from_ms < ? AND to_ms > ? ORDER BY from_ms, class"
    return [File(*row) for row in db.execute(asked, (machine, from_ms - DAY_MS - 1, to_ms, from_ms))]


def file_name(stored_class: StoredClass, machine: str, from_ms: int, to_ms: int, number: int) -> str:
    """Return the path of a file.

    >>> file_name(StoredClass.RAW, "vmc/1", 1_790_046_000_000, 1_790_049_600_000, 7)
    'cnc_raw/machine=vmc%2F1/day=2026-09-22/03-04.7.parquet'
    """
    name = quote(machine, safe="")
    if len(name) > _NAME_MAX:
        name = name[:100].rstrip("%") + "~" + hashlib.sha256(machine.encode()).hexdigest()[:16]
    day = datetime.fromtimestamp(from_ms / 1000, UTC)
    hours = f"{day.hour:02}-{day.hour + (to_ms - from_ms) // HOUR_MS:02}"
    return f"{FOLDERS[stored_class]}/machine={name}/day={day:%Y-%m-%d}/{hours}.{number}.parquet"


def put(folder: Path, name: str, body: bytes) -> None:
    """Write a file so that it is there in whole, or not, also when the power goes. Raises StoreError."""
    path = folder / name
    part = path.with_name(path.name + ".part")
    try:
        make_folder(path.parent)
        with part.open("wb") as file:
            file.write(body)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
        sync(path.parent)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror or error}") from error


class Checked:
    """Files whose bytes were compared with their checksum; each process does that the first time it reads one."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lock, self._sound, self.damaged = threading.Lock(), set[str](), dict[str, str]()

    def sound(self, wanted: Iterable[File]) -> list[File]:
        """Those that are as they were written; FileNotFoundError where one is gone, which a sweep beside us may have done."""
        return [file for file in wanted if self._is_sound(file)]

    def _is_sound(self, file: File) -> bool:
        with self._lock:
            if file.name in self._sound:
                if not (self.folder / file.name).exists():
                    raise FileNotFoundError(file.name)
                return True
            if file.name in self.damaged:
                return False
        path = self.folder / file.name
        try:
            body = path.read_bytes()
        except FileNotFoundError:
            raise
        except OSError as error:
            trouble = f"{path}: cannot be read: {error.strerror or error}"
        else:
            trouble = "" if zlib.crc32(body) == file.crc else f"{path}: is damaged ({len(body)} bytes, {file.bytes} were written)"
        with self._lock:
            if trouble:
                self.damaged[file.name] = trouble
            else:
                self._sound.add(file.name)
        return not trouble
