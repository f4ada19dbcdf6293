"""The disks of the plant: real files in a temporary folder, and what is left of them when a process or the power goes.

SQLite in WAL mode appends frames to `-wal` and copies them to the database at a checkpoint; `-shm` says how many frames are
committed, and how many are copied. What is surely on the platter is read from there:

    synchronous=FULL      every committed frame
    synchronous=NORMAL    the frames that a checkpoint has copied, and those that somebody has synced with os.fsync

A kill -9 keeps every committed frame. A power cut keeps those that are synced, and of the others as many as the seed draws, the
last one perhaps torn. Other files keep their content where they were synced; else they may be empty or cut short.

Not modelled: pages that reach the platter in another order than they were written, renames that are lost, sealed hours (a run is
shorter than an hour), bits that rot.
"""

import fcntl
import os
import shutil
import sqlite3
import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from tests.plant.simulation.kernel import Kernel, Process

FREE_BYTES = 50_000_000_000
WAL_HEADER, FRAME_HEADER = 32, 24
_WRITES = ("INSERT", "DELETE", "UPDATE", "REPLACE", "COMMIT", "BEGIN IMMEDIATE")


class Frames(NamedTuple):
    """The index of a WAL: its salt, the bytes of a page, committed frames, frames copied to the database."""

    salt: bytes
    page: int
    committed: int
    copied: int


class Usage(NamedTuple):
    """As shutil.disk_usage gives it."""

    total: int
    used: int
    free: int


class Disk:
    """The disks of all processes; the folder of a process is its own."""

    def __init__(self, kernel: Kernel, folder: Path) -> None:
        self.kernel, self.folder = kernel, folder
        self.full: set[str] = set()  # names of processes whose disk takes nothing
        self.kill_at: dict[str, int] = {}  # process → how many more steps of its disk it lives to see
        self.steps = 0
        self._databases: dict[int, tuple[Process, list[Database]]] = {}
        self._locked: dict[int, list[Any]] = {}
        self._synced: dict[tuple[int, int], tuple[int, int]] = {}  # inode → size and time as synced
        self._synced_frames: dict[str, Frames] = {}

    # What stands for modules.

    def connect(self, file: Any, *args: Any, **options: Any) -> sqlite3.Connection:
        """As sqlite3.connect."""
        if self.kernel.task is None and not self.kernel.is_over:
            return sqlite3.connect(file, *args, **options)  # who judges the plant is no process of it
        process = self.kernel.me().process
        database = sqlite3.connect(file, *args, factory=Database, **options)
        assert isinstance(database, Database)
        database.disk, database.process, database.file = self, process, str(file)
        self._databases.setdefault(id(process), (process, []))[1].append(database)
        return database

    def fsync(self, descriptor: int) -> None:
        """As os.fsync; the last moment of a process may be just before it, or just after."""
        self.step()
        path = str(Path(f"/proc/self/fd/{descriptor}").readlink())
        if path.endswith("-wal"):
            if (frames := frames_of(path.removesuffix("-wal"))) is not None:
                self._synced_frames[path] = frames
        else:
            found = os.fstat(descriptor)
            self._synced[found.st_dev, found.st_ino] = found.st_size, found.st_mtime_ns
        self.step()

    def flock(self, file: Any, operation: int) -> None:
        """As fcntl.flock; a lock goes with its process."""
        fcntl.flock(file, operation)
        self._locked.setdefault(id(self.kernel.me().process), []).append(file)

    def usage(self, folder: Any) -> Usage:
        """As shutil.disk_usage."""
        task = self.kernel.task
        is_full = task is not None and task.process.name in self.full
        return Usage(100_000_000_000, 0, 0 if is_full else FREE_BYTES)

    def step(self) -> None:
        """A moment in which a process may die: just before or after it touches its disk."""
        task = self.kernel.task
        if task is None:
            return
        self.steps += 1
        name = task.process.name
        left = self.kill_at.get(name)
        if left is not None:
            if left <= 0:
                del self.kill_at[name]
                self.kernel.note("killed at its disk", name)
                task.process.kill()
            else:
                self.kill_at[name] = left - 1

    # What happens to them.

    def died(self, process: Process) -> None:
        """A process was killed: its files stay as the system has them."""
        self._close(process, lambda wal, frames: None)

    def lost_power(self, process: Process, folder: Path, chance: Random) -> None:
        """The power of a process's computer is cut."""

        def tear(wal: Path, frames: Frames) -> None:
            size = FRAME_HEADER + frames.page
            synced = self._safe(str(wal), frames)
            kept = synced + chance.randint(0, frames.committed - synced) if chance.random() < 0.7 else synced
            end = WAL_HEADER + kept * size
            content = wal.read_bytes()[: end + (chance.randint(0, size) if chance.random() < 0.5 else 0)]
            if len(content) > end + 8:
                content = content[:-8] + bytes(8)
            wal.write_bytes(content)

        self._close(process, tear)
        for file in sorted(folder.glob("**/*")):
            if not file.is_file() or file.name.startswith(("store.sqlite", "ring.store")):
                continue
            found = file.stat()
            is_synced = self._synced.get((found.st_dev, found.st_ino)) == (found.st_size, found.st_mtime_ns)
            if not is_synced and chance.random() < 0.5:
                content = file.read_bytes()
                file.write_bytes(content[: chance.randint(0, len(content))])

    def _safe(self, wal: str, frames: Frames) -> int:
        """Return how many frames are surely on the platter."""
        for database in self._all(wal.removesuffix("-wal")):
            if database.is_full_sync:
                return frames.committed
        noted = self._synced_frames.get(wal)
        synced = noted.committed if noted is not None and noted.salt == frames.salt else 0
        return min(max(synced, frames.copied), frames.committed)

    def _all(self, file: str) -> list["Database"]:
        return [one for _, databases in self._databases.values() for one in databases if one.file == file]

    def _close(self, process: Process, change: Callable[[Path, Frames], None]) -> None:
        """Close what a process has open, which would tidy up, and put the files back as they were before."""
        _, databases = self._databases.get(id(process), (process, []))
        paths = dict.fromkeys(database.file for database in databases)
        kept: list[tuple[Path, bytes]] = []
        for file in paths:
            path, wal = Path(file), Path(file + "-wal")
            if not path.exists():
                continue
            kept.append((path, path.read_bytes()))
            if wal.exists():
                frames = frames_of(file)
                if frames is not None and frames.committed:
                    change(wal, frames)
                    kept.append((wal, wal.read_bytes()))
        for database in databases:
            with suppress(sqlite3.Error):
                database.really_close()
        for file in self._locked.pop(id(process), ()):
            if not file.closed:
                fcntl.flock(file, fcntl.LOCK_UN)
        self._databases.pop(id(process), None)
        for file in paths:
            for tail in ("-wal", "-shm"):
                Path(file + tail).unlink(missing_ok=True)
        for path, content in kept:
            path.write_bytes(content)

    def close(self) -> None:
        """Close everything, and delete the folder."""
        for _, databases in self._databases.values():
            for database in databases:
                with suppress(sqlite3.Error):
                    database.really_close()
        self._databases.clear()
        shutil.rmtree(self.folder, ignore_errors=True)


class Database(sqlite3.Connection):
    """A connection of a process of the plant."""

    disk: Disk
    process: Process
    file: str
    is_full_sync = False

    def execute(self, text: str, *args: Any) -> sqlite3.Cursor:  # type: ignore[override]
        """As sqlite3's, with the moments in which the process may die."""
        is_write = text.lstrip().startswith(_WRITES)
        if is_write:
            self._before()
        elif "synchronous" in text and "=" in text:
            self.is_full_sync = text.rpartition("=")[2].strip(" ;").lower() in ("full", "extra", "2", "3")
        found = super().execute(text, *args)
        if is_write:
            self.disk.step()
        return found

    def executemany(self, text: str, *args: Any) -> sqlite3.Cursor:  # type: ignore[override]
        """As sqlite3's."""
        self._before()
        return super().executemany(text, *args)

    def _before(self) -> None:
        if not self.process.is_alive:
            raise sqlite3.OperationalError("the process is dead")
        self.disk.step()
        if self.process.name in self.disk.full and self.disk.kernel.chance.random() < 0.5:
            raise sqlite3.OperationalError("database or disk is full")

    def close(self) -> None:
        """As sqlite3's; of a dead process it is closed already."""
        if self.process.is_alive:
            self.really_close()

    def really_close(self) -> None:
        """Close it."""
        super().close()


def frames_of(file: str) -> Frames | None:
    """Read the index of a database's WAL (https://sqlite.org/walformat.html); None where there is none."""
    try:
        with Path(file + "-shm").open("rb") as index:
            head = index.read(100)
    except OSError:
        return None
    if len(head) < 100:
        return None
    page, committed = struct.unpack_from("=HI", head, 14)
    (copied,) = struct.unpack_from("=I", head, 96)
    return Frames(head[32:40], 65_536 if page == 1 else page, committed, copied)
