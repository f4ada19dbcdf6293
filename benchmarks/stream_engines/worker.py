"""A worker of an engine as a process: started, its processor time counted with that of its children, killed with -9."""

import os
import shutil
import signal
import subprocess
from contextlib import suppress
from pathlib import Path

from benchmarks.stream_engines.order import Order

ROOT = Path(__file__).parents[2]
TICKS = os.sysconf("SC_CLK_TCK")


def family(pid: int) -> dict[int, int]:
    """Return the processor time, in ticks, of a process and all that descend from it."""
    parents, ticks = dict[int, int](), dict[int, int]()
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            one, words = int(path.parent.name), path.read_text().rpartition(")")[2].split()
            parents[one], ticks[one] = int(words[1]), int(words[11]) + int(words[12])
    found = {pid} & ticks.keys()
    while more := {one for one, parent in parents.items() if parent in found} - found:
        found |= more
    return {one: ticks[one] for one in found}


class Worker:
    """A worker with its own folder of state."""

    def __init__(self, python: Path, module: str, order: Order, log: Path) -> None:
        self.python, self.module, self.order, self.log = python, module, order, log
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start the process."""
        Path(self.order.state_dir).mkdir(parents=True, exist_ok=True)
        command = [self.python, "-m", f"benchmarks.stream_engines.{self.module}", *self.order.words()]
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(
                command, cwd=self.order.state_dir, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=self._environment()
            )

    @staticmethod
    def _environment() -> dict[str, str]:
        return {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}

    @property
    def running(self) -> bool:
        """True while the process lives."""
        return self._process is not None and self._process.poll() is None

    def cpu_s(self) -> float:
        """Return the seconds of processor time that the process and its children, all threads, have used."""
        assert self._process is not None
        return sum(family(self._process.pid).values()) / TICKS

    def kill(self, *, state: bool = True) -> None:
        """Kill the process and its children with -9 and, where asked, delete the local state."""
        if self._process is None:
            return
        for pid in family(self._process.pid) if self.running else ():
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self._process.wait()
        if state:
            shutil.rmtree(self.order.state_dir, ignore_errors=True)

    def last_words(self) -> str:
        """Return the end of its output."""
        lines = self.log.read_text(errors="replace").strip().splitlines() if self.log.exists() else []
        return " / ".join(lines[-4:]) or "it said nothing"
