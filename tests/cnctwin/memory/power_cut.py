"""The disk after the power went: it holds only what was forced to it (`fsync`, `fdatasync`) before.

A program runs under strace, which tells its writes in their order. They are played into files and folders that have two states:
what the system has and what the disk has. The bytes of a file reach the disk where the file is synced, the entries of a folder
where the folder is: the harshest disk that POSIX allows. Each line that the program writes to stdout is the moment of a cut.
"""

import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

CALLS = "openat,write,pwrite64,ftruncate,fsync,fdatasync,rename,unlink,mkdir"
_CALL = re.compile(r"^(?:\d+ +)?(\w+)\((.*)\) += (\d+)")
_FD = re.compile(r"^\d+<([^>]*)>")
_TEXT = re.compile(r'"((?:\\x[0-9a-f]{2})*)"')


class Cut(NamedTuple):
    """The last words of the program, and the files that the disk has then, by path."""

    said: str
    files: dict[Path, bytes]


@dataclass(slots=True)
class _File:
    system: bytearray = field(default_factory=bytearray)
    disk: bytes | None = None


class _Disk:
    """The files and folders below `root`; a folder has no bytes."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._system: dict[Path, _File | None] = {}
        self._entries: dict[Path, _File | None] = {}  # that the disk has

    def call(self, name: str, path: Path, arguments: str, number: int) -> None:
        """A system call that has succeeded, on the file or folder `path`; `number` is what it returned."""
        file = self._system.get(path)
        if name in ("fsync", "fdatasync"):
            if file is not None:
                file.disk = bytes(file.system)
            else:
                self._entries = {p: f for p, f in self._entries.items() if p.parent != path}
                self._entries |= {p: f for p, f in self._system.items() if p.parent == path}
        elif name == "mkdir":
            self._system[path] = None
        elif name == "unlink":
            self._system.pop(path, None)
        elif name == "rename":
            self._system[Path(_texts(arguments)[1].decode())] = self._system.pop(path, None)
        elif name == "openat" and "O_CREAT" in arguments:
            file = self._system.setdefault(path, _File()) or _File()
            file.system = bytearray() if "O_TRUNC" in arguments else file.system
        elif name == "ftruncate" and file is not None:
            size = int(arguments.rpartition(",")[2])
            file.system = file.system[:size].ljust(size, b"\0")
        elif name in ("write", "pwrite64") and file is not None:
            (body,) = _texts(arguments)
            assert len(body) == number, "strace tells each write in whole"
            at = int(arguments.rpartition(",")[2]) if name == "pwrite64" else len(file.system)
            file.system.extend(b"\0" * max(at + len(body) - len(file.system), 0))
            file.system[at : at + len(body)] = body

    def files(self) -> dict[Path, bytes]:
        """Return what is left after a cut: a file is found where all folders above it are."""
        return {
            path: file.disk
            for path, file in self._entries.items()
            if file is not None and file.disk is not None and all(self._is_found(above) for above in path.parents)
        }

    def _is_found(self, folder: Path) -> bool:
        return folder in self._entries or folder == self._root or folder in self._root.parents


def is_possible() -> bool:
    """Return True where strace is there and may look at a program."""
    return (
        shutil.which("strace") is not None and not subprocess.run(["strace", "-o", "/dev/null", "true"], check=False).returncode
    )


def cuts(root: Path, log: Path, *command: str) -> Iterator[Cut]:
    """Run a program that writes below `root`, a folder that is there, and yield the disk at each line that it says."""
    strace = ["strace", "-y", "-xx", "-s", "10000000", "-e", f"trace={CALLS}", "-o", str(log)]
    subprocess.run([*strace, *command], check=True, timeout=300.0, stdout=subprocess.DEVNULL)
    disk = _Disk(root)
    with log.open(encoding="ascii", errors="replace") as lines:
        for line in lines:
            found = _CALL.match(line)
            if found is None:
                continue
            name, arguments, number = found[1], found[2], int(found[3])
            if name == "write" and arguments.startswith("1<"):
                yield Cut(_texts(arguments)[0].decode().strip(), disk.files())
            else:
                disk.call(name, _path(name, arguments, line), arguments, number)


def lay_out(cut: Cut, root: Path, there: Path) -> None:
    """Write what the disk had below `root` into another folder."""
    for path, body in cut.files.items():
        file = there / path.relative_to(root)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(body)


def _texts(arguments: str) -> list[bytes]:
    return [bytes.fromhex(text.replace("\\x", "")) for text in _TEXT.findall(arguments)]


def _path(name: str, arguments: str, line: str) -> Path:
    if name in ("rename", "unlink", "mkdir"):
        return Path(_texts(arguments)[0].decode())
    told = line.rpartition("<")[2].partition(">")[0] if name == "openat" else (_FD.match(arguments) or ["", ""])[1]
    return Path(bytes.fromhex(told.replace("\\x", "")).decode() if told.startswith("\\x") else told)
