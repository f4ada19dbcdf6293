"""The record of who did what: a JSON line for each action, in a file of mode 600 that only grows until it is set aside.

A line is `{"at", "user", "role", "address", "action", "object", "outcome"}`; `outcome` is `done`, or the refusal. No token and no
body is in it. Refusals of an address, and of all together, are limited a minute, so that nobody writes the file full to have the
rest set aside: what is left out is counted in the next line, as `left_out`.
"""

import errno
import json
import os
import threading
from collections import deque
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

BYTES_MAX = 2_000_000
FILES_MAX = 5
REMEMBERED_MAX = 500
TEXT_MAX = 200
WINDOW_S = 60.0
REFUSALS_OF_ONE_MAX = 10
REFUSALS_MAX = 100
DONE = "done"


class Deed(NamedTuple):
    """One action: who did it, on what, and what came of it."""

    user: str
    role: str
    address: str
    action: str
    object: str
    outcome: str = DONE


class AuditLog:
    """Notes deeds in a file; without one, in memory only. Threads may share it."""

    def __init__(self, file: Path | None = None) -> None:
        self.file = file
        self.trouble = ""
        self._lock = threading.Lock()
        self._left_out = 0
        self._refusals: deque[tuple[float, str]] = deque(maxlen=REFUSALS_MAX)
        self._newest: deque[dict[str, Any]] = deque(_read(file), REMEMBERED_MAX)

    def note(self, deed: Deed, now_s: float) -> None:
        """Add a line. A disk that cannot take it is reported by `trouble`, and hinders nobody."""
        with self._lock:
            if deed.outcome != DONE and not self._may_refuse(deed.address, now_s):
                self._left_out += 1
                return
            at = datetime.fromtimestamp(now_s, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
            told: dict[str, Any] = {"at": at, **{name: _short(text) for name, text in deed._asdict().items()}}
            if self._left_out:
                told["left_out"], self._left_out = self._left_out, 0
            self._newest.append(told)
            try:
                self._write(told)
                self.trouble = ""
            except OSError as error:
                self.trouble = f"{self.file}: {error.strerror}; make room, or name another file with --audit"

    def newest(self, count: int) -> list[dict[str, Any]]:
        """Return the newest lines, the newest first."""
        with self._lock:
            return list(reversed(self._newest))[:count]

    def _may_refuse(self, address: str, now_s: float) -> bool:
        while self._refusals and not 0.0 <= now_s - self._refusals[0][0] < WINDOW_S:
            self._refusals.popleft()
        of_one = sum(one == address for _, one in self._refusals)
        if len(self._refusals) >= REFUSALS_MAX or of_one >= REFUSALS_OF_ONE_MAX:
            return False
        self._refusals.append((now_s, address))
        return True

    def _write(self, told: dict[str, Any]) -> None:
        if self.file is None:
            return
        line = json.dumps(told, separators=(",", ":")).encode() + b"\n"
        self.file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        descriptor = os.open(self.file, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        try:
            os.fchmod(descriptor, 0o600)
            size = os.fstat(descriptor).st_size
            if size and os.pread(descriptor, 1, size - 1) != b"\n":
                line = b"\n" + line  # half a line of a power cut, or of a disk that was full, stays one of its own
            if os.write(descriptor, line) < len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            size += len(line)
        finally:
            os.close(descriptor)
        if size >= BYTES_MAX:
            _set_aside(self.file)


def _set_aside(file: Path) -> None:
    """Begin a new file; the oldest one goes."""
    for number in range(FILES_MAX - 1, 0, -1):
        older = file.with_name(f"{file.name}.{number}")
        newer = file if number == 1 else file.with_name(f"{file.name}.{number - 1}")
        if newer.exists():
            newer.replace(older)


def _read(file: Path | None) -> list[dict[str, Any]]:
    """The lines that are there already; what is none, as half a line after a power cut, is passed over."""
    if file is None:
        return []
    lines: list[bytes] = []
    for path in (file.with_name(f"{file.name}.1"), file):
        try:
            with path.open("rb") as opened:
                lines += opened.read(2 * BYTES_MAX).splitlines()
        except OSError:
            continue
    return [told for line in lines[-REMEMBERED_MAX:] if (told := _parsed(line)) is not None]


def _parsed(line: bytes) -> dict[str, Any] | None:
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def _short(text: str) -> str:
    """Return a text in one line, cut, and without what a terminal would obey."""
    line = "".join(sign if sign.isprintable() else " " for sign in text)
    return line if len(line) <= TEXT_MAX else f"{line[:TEXT_MAX]}…"
