"""One process is an edge node: a locked file beside its session file, which says who. The lock goes with the process, however it
ends, so that one that was killed keeps nobody waiting.

Two processes that are one node throw each other off the broker for ever, and spoil each other's files.
"""

import fcntl
import json
import os
import socket
import sys
import threading
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import IO

from sparkplug.errors import AnotherRunsError, SparkplugError

ARGUMENTS_SHOWN = 4
_held: dict[Path, tuple[IO[str], int]] = {}  # by this process, and by how many of its nodes: one may follow another here
_guard = threading.Lock()


class SessionLock:
    """Held from the making until `release`. Raises AnotherRunsError where another process holds it."""

    def __init__(self, session_file: Path, node: str) -> None:
        self._path: Path | None = session_file.with_name(session_file.name + ".lock").resolve()
        with _guard:
            file, nodes = _held.get(self._path, (None, 0))
            _held[self._path] = (file or _locked(self._path, node), nodes + 1)

    def release(self) -> None:
        """Let go; another process may be the node now."""
        with _guard:
            path, self._path = self._path, None
            if path is None:
                return
            file, nodes = _held.pop(path)
            if nodes > 1:
                _held[path] = (file, nodes - 1)
            else:
                file.close()


def _locked(path: Path, node: str) -> IO[str]:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file: IO[str] = path.open("a+", encoding="utf-8")
    except OSError as error:
        raise SparkplugError(f"{path}: cannot be written: {error.strerror or error}; name another folder for the state") from None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        holder = _holder(file)
        file.close()
        raise AnotherRunsError(
            f"another one runs: {holder} is the node {node} already, with {path.with_suffix('')}; "
            "end that one first, or give this one another name and another folder for its state"
        ) from None
    command = " ".join([Path(sys.argv[0]).name, *sys.argv[1 : 1 + ARGUMENTS_SHOWN]])
    told = {"host": socket.gethostname(), "pid": os.getpid(), "command": command}
    file.seek(0)
    file.truncate()
    file.write(json.dumps(told | {"since": datetime.now(UTC).isoformat(timespec="seconds")}))
    file.flush()
    return file


def _holder(file: IO[str]) -> str:
    with suppress(OSError, ValueError, KeyError, TypeError):
        file.seek(0)
        told = json.loads(file.read())
        return f"process {told['host']}:{told['pid']} ({told['command']}, since {told['since']})"
    return "another process"
