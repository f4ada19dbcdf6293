"""One process writes a store: a locked file that says who. The lock goes with the process, however it ends."""

import fcntl
import json
import os
import sys
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import IO

from cnctwin.memory.store.contract import StoreError

FILE_NAME = "writer.lock"
_ARGUMENTS_SHOWN = 4


class WriterLock:
    """Held from the making until `release`. Raises StoreError where another process holds it.

    was_clean: the last writer has let go of it by its own will
    """

    def __init__(self, folder: Path, now_ms: int) -> None:
        self._path = folder / FILE_NAME
        self._file: IO[str] = self._path.open("a+", encoding="utf-8")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            holder = self._holder()
            self._file.close()
            raise StoreError(f"{folder}: {holder} writes this store already, and only one may; end that one first") from None
        self._file.seek(0)
        self.was_clean = not self._file.read().strip()
        since = datetime.fromtimestamp(now_ms / 1000, UTC).isoformat(timespec="seconds")
        command = " ".join([Path(sys.argv[0]).name, *sys.argv[1 : 1 + _ARGUMENTS_SHOWN]])
        self._write(json.dumps({"pid": os.getpid(), "command": command, "since": since}))

    def _holder(self) -> str:
        with suppress(OSError, ValueError, KeyError, TypeError):
            self._file.seek(0)
            told = json.loads(self._file.read())
            return f"process {told['pid']} ({told['command']}, since {told['since']})"
        return "another process"

    def _write(self, text: str) -> None:
        self._file.seek(0)
        self._file.truncate()
        self._file.write(text)
        self._file.flush()

    def release(self, *, is_clean: bool = True) -> None:
        """Let go; the file stays, empty. is_clean: the next writer need not look for damage."""
        if not self._file.closed:
            with suppress(OSError):
                self._write("" if is_clean else "the last writer has met damage")
            self._file.close()
