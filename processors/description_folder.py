"""The folder in which people describe machines, looked at once a second: what is new in it, and which file is wrong.

    machines/<name>.toml                        the live description of machine <name>
    machines/challengers/<name>.toml            one that runs beside it, if any
    machines/history/<name>/steps.jsonl         who made which version live, and why: one JSON line for each step
    machines/history/<name>/<version>.programs.json     what a version plans for programs: name → seconds of its sections

It is only read. A file that is being written is left alone until it has been quiet for SETTLED_S, and the challenger's as long as
the live one is: a promotion takes the challenger away, whose state the processors hand over when they hear the live one first.
"""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import TypeAdapter

from processors.description import Description, DescriptionMessage, Programs, Role, version_of
from twin.errors import MachineError

CHALLENGERS, HISTORY, STEPS = "challengers", "history", "steps.jsonl"
SETTLED_S = 0.2
FILE_BYTES_MAX = 1_000_000
STEPS_BYTES_MAX = 1_000_000  # at the end of the log: older steps are not looked for
MACHINES_MAX = 1000
BY_HAND = "file"
Key = tuple[str, Role]
_Stamp = tuple[int, int, int]
PROGRAMS = ".programs.json"
_PROGRAMS: TypeAdapter[Programs] = TypeAdapter(Programs)


class FileNews(NamedTuple):
    """A file that is new, has changed or is gone. Without `message` and `fault` there is none any more."""

    machine: str
    role: Role
    message: DescriptionMessage | None
    fault: str = ""


class DescriptionFolder:
    """See the module. `look` is called by one thread."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._stamps: dict[Key, _Stamp] = {}
        self._planned: dict[Key, tuple[Path, _Stamp | None]] = {}  # the planned programs of the version that was read last

    def look(self, now_s: float | None = None) -> list[FileNews]:
        """Return what has changed since it was looked at last, the live description of a machine before its challenger.

        now_s: seconds since 1970
        """
        now_s = time.time() if now_s is None else now_s
        files = dict(self._files())
        news: list[FileNews] = []
        unsettled: set[str] = set()
        for key in sorted({*files, *self._stamps}, key=lambda key: (key[0], key[1] is Role.CHALLENGER)):
            path = files.get(key)
            stamp = None if path is None else _stamp(path)
            is_same = stamp == self._stamps.get(key) and not self._is_planned_anew(key)
            if not is_same and stamp is not None and 0 <= now_s - stamp[0] / 1e9 < SETTLED_S:
                unsettled.add(key[0])
            if is_same or key[0] in unsettled:
                continue
            if path is None or stamp is None:
                if self._stamps.pop(key, None) is not None:
                    news.append(FileNews(*key, None))
                continue
            self._stamps[key] = stamp
            news.append(self._read(key, path, stamp))
        return news

    @property
    def machines(self) -> frozenset[str]:
        """The machines that the folder says something about."""
        return frozenset(machine for machine, _ in self._stamps)

    def _files(self) -> Iterator[tuple[Key, Path]]:
        for role, folder in ((Role.LIVE, self.folder), (Role.CHALLENGER, self.folder / CHALLENGERS)):
            paths = sorted(path for path in folder.glob("*.toml") if not path.name.startswith("."))
            for path in paths[:MACHINES_MAX]:
                yield (path.stem, role), path

    def _read(self, key: Key, path: Path, stamp: _Stamp) -> FileNews:
        try:
            if stamp[1] > FILE_BYTES_MAX:
                raise MachineError(f"{path}: {stamp[1]} bytes are more than the {FILE_BYTES_MAX} of a description")
            text = path.read_text(encoding="utf-8")
            Description.from_toml(text, str(path))
        except (OSError, UnicodeDecodeError) as error:
            return FileNews(*key, None, f"{path}: cannot be read: {error}")
        except MachineError as error:
            return FileNews(*key, None, str(error))
        return FileNews(*key, self._message(key, text, stamp[0] // 1_000_000))

    def _message(self, key: Key, text: str, written_ms: int) -> DescriptionMessage:
        """The description with who made it what it is, as the log of its machine says; else it was the file."""
        version = version_of(text)
        step = self._step(key[0], version)
        try:
            described = {"version": version, "toml": text, "programs": self._programs(key, version)}
            return DescriptionMessage.model_validate({"t": written_ms, "by": BY_HAND} | step | described)
        except ValueError:
            return DescriptionMessage(version=version, toml=text, t=written_ms, by=BY_HAND)

    def _is_planned_anew(self, key: Key) -> bool:
        path, stamp = self._planned.get(key, (None, None))
        return path is not None and _stamp(path) != stamp

    def _programs(self, key: Key, version: str) -> Programs:
        """The programs that a version plans; none where the file is not there, or is not what it should be."""
        path = self.folder / HISTORY / key[0] / f"{version}{PROGRAMS}"
        self._planned[key] = path, _stamp(path)
        try:
            return _PROGRAMS.validate_json(path.read_bytes()[:FILE_BYTES_MAX])
        except (OSError, ValueError):
            return {}

    def _step(self, machine: str, version: str) -> dict[str, Any]:
        """The last step of a version; empty where the log has none."""
        path = self.folder / HISTORY / machine / STEPS
        try:
            with path.open("rb") as log:
                log.seek(max(path.stat().st_size - STEPS_BYTES_MAX, 0))
                lines = log.read().splitlines()
        except OSError:
            return {}
        for line in reversed(lines):
            try:
                step = json.loads(line)
            except ValueError:
                continue
            if isinstance(step, dict) and step.get("version") == version:
                return {name: step[name] for name in ("t", "step", "by", "why") if name in step}
        return {}


def _stamp(path: Path) -> _Stamp | None:
    """Return its time of writing, its length and its number; None where there is no such file."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
