"""A real Dask cluster on this machine: a scheduler and workers, each a process that can be killed."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from tests.recordings import PROJECT

START_S_MAX = 60.0


@dataclass(slots=True)
class DaskProcesses:
    """The processes. `tls`: options that both kinds take."""

    folder: Path
    tls: tuple[str, ...] = ()
    scheduler: subprocess.Popen[bytes] | None = None
    workers: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def start_scheduler(self) -> str:
        """Its address."""
        file, host = self.folder / "scheduler.json", "tls://127.0.0.1" if self.tls else "tcp://127.0.0.1"
        self.scheduler = self._start("scheduler", "--host", host, "--port", "0", "--no-show", "--scheduler-file", str(file))
        end_s = time.monotonic() + START_S_MAX
        while time.monotonic() < end_s and self.scheduler.poll() is None:
            if file.exists() and file.read_text().endswith("}"):
                return str(json.loads(file.read_text())["address"])
            time.sleep(0.05)
        raise AssertionError((self.folder / "dask.log").read_text())

    def start_worker(self, address: str) -> subprocess.Popen[bytes]:
        """One process with one thread, and nobody who starts it again when it is killed."""
        options = ("--nthreads", "1", "--no-nanny", "--memory-limit", "0", "--local-directory", str(self.folder))
        self.workers.append(self._start("worker", address, *options))
        return self.workers[-1]

    def _start(self, kind: str, *options: str) -> subprocess.Popen[bytes]:
        environment = os.environ | {"PYTHONPATH": str(PROJECT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *options, "--no-dashboard", *self.tls]
        with (self.folder / "dask.log").open("ab") as log:
            return subprocess.Popen(command, env=environment, stdout=log, stderr=subprocess.STDOUT)


@contextmanager
def dask_processes(folder: Path, tls: tuple[str, ...] = ()) -> Iterator[DaskProcesses]:
    """Processes that end with the block."""
    processes = DaskProcesses(folder, tls)
    try:
        yield processes
    finally:
        for process in filter(None, [*processes.workers, processes.scheduler]):
            process.kill()
            process.wait()
