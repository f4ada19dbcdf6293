"""Processes of ours that must not outlive us, and that are started again when they die."""

import ctypes
import logging
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

_PR_SET_PDEATHSIG = 1
_log = logging.getLogger(__name__)
RESTART_S_MIN = 0.5
STOP_S_MAX = 8.0


def die_with_parent() -> None:
    """Have the kernel end this process when its parent ends, even by kill -9 (Linux; elsewhere the parent's stop does it)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


@dataclass(slots=True)
class Child:
    """One process. Call `watch` now and then: it starts the process again when it has died."""

    name: str
    command: Sequence[str]
    log: Path
    clock: Callable[[], float] = time.monotonic
    restarts: int = 0
    _process: subprocess.Popen[bytes] | None = None
    _log_file: IO[bytes] | None = None
    _started_s: float = field(default=0.0)

    def start(self) -> None:
        """Start the process; its output goes into the log file."""
        if self._log_file is None:
            self._log_file = self.log.open("ab")
        self._started_s = self.clock()
        self._process = subprocess.Popen(
            self.command,
            stdin=subprocess.DEVNULL,
            stdout=self._log_file,
            stderr=subprocess.STDOUT,
            preexec_fn=die_with_parent,  # noqa: PLW1509 — one prctl call, and we start children from one thread
            start_new_session=True,  # Ctrl-C reaches us alone; we stop the children in order
        )

    @property
    def running(self) -> bool:
        """True if the process lives."""
        return self._process is not None and self._process.poll() is None

    @property
    def pid(self) -> int | None:
        """The process id."""
        return None if self._process is None else self._process.pid

    def watch(self) -> bool:
        """Start the process again if it has died; True where that was needed."""
        if self.running or self.clock() - self._started_s < RESTART_S_MIN:
            return False
        code = None if self._process is None else self._process.returncode
        _log.warning("%s ended with %s; it is started again", self.name, code)
        self.restarts += 1
        self.start()
        return True

    def stop(self) -> None:
        """Ask the process to end, and make it end if it does not."""
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(STOP_S_MAX)
            except subprocess.TimeoutExpired:
                _log.warning("%s did not end within %g s of being asked; it is killed", self.name, STOP_S_MAX)
                self._process.kill()
                self._process.wait()
        if self._log_file is not None:
            self._log_file.close()
            self._log_file = None

    def last_words(self, lines: int = 3) -> str:
        """The end of the process's output."""
        try:
            return " / ".join(self.log.read_text(errors="replace").strip().splitlines()[-lines:])
        except OSError:
            return ""
