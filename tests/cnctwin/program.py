"""The command as a user starts it: a process of its own, with what it said and which processes it has."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType

WAIT_S_MAX = 60.0  # the tests run beside others


def until(condition: Callable[[], bool], what: str, seconds: float = WAIT_S_MAX) -> None:
    """Wait until something is the case."""
    deadline_s = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline_s, f"waited {seconds:g} s for {what}"
        time.sleep(0.05)


def is_alive(pid: int) -> bool:
    """Return whether a process runs; one that is dead and not yet collected does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def children(pid: int) -> dict[str, int]:
    """The processes that one has started, by a word of their command line that tells which they are."""
    words = ("mosquitto", "simulate-control", "historian", "process", "serve", "jobs", "edge", "twin")
    found = {}
    for folder in Path("/proc").iterdir():
        try:
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            command = (folder / "cmdline").read_text().split("\0")
        except (OSError, IndexError):
            continue
        if parent == pid:
            name = next((word for word in words if word in command or command[0].endswith(word)), command[0])
            found[name] = int(folder.name)
    return found


class Program:
    """`cnctwin` with these arguments, started; killed at the end of the block where it still runs."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self._folder = folder
        command = [sys.executable, "-m", "cnctwin", *arguments]
        # A program that is killed leaves its temporary folder behind; this one pytest removes.
        environment = {**os.environ, "TMPDIR": str(folder)}
        with (folder / "out").open("wb") as out, (folder / "err").open("wb") as err:
            self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=err, env=environment)

    def __enter__(self) -> "Program":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()

    @property
    def out(self) -> str:
        """Return what it wrote to stdout."""
        return (self._folder / "out").read_text()

    @property
    def err(self) -> str:
        """Return what it wrote to stderr."""
        return (self._folder / "err").read_text()

    def ask_to_end(self, number: int) -> int:
        """Send a signal; the exit code."""
        self.process.send_signal(number)
        return self.wait()

    def wait(self, seconds: float = WAIT_S_MAX) -> int:
        """The exit code, when it has ended."""
        return self.process.wait(seconds)
