"""A kind of job for tests: counts, with a chain of hashes that another count would not have, and comes to harm as it is told.

As a program it is the process of a job that knows this kind: `python -m tests.cnctwin.jobs.counting FOLDER --attempt N`.
"""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from pydantic import Field

from cnctwin.errors import SpreadError, UsageError
from cnctwin.jobs import child
from cnctwin.jobs.durable import read_json, write_json
from cnctwin.jobs.files_root import FilesRoot
from cnctwin.jobs.kinds import KINDS, Kind, Parameters
from cnctwin.jobs.work import Bench


class CountParameters(Parameters):
    """What happens on the way.

    kill_at: numbers at which it is killed, once each; hold_at: number at which it waits for the file `go`
    fail: what happens at the end; companion: it starts another process
    """

    to: int = Field(ge=0, le=10_000)
    pause_s: float = 0.0
    machine: str = ""
    kill_at: list[int] = Field(default_factory=list)
    hold_at: int | None = None
    fail: str = ""
    companion: bool = False

    def machine_of(self, files: FilesRoot) -> str:
        """As told."""
        return self.machine


def count(parameters: CountParameters, bench: Bench) -> dict[str, Any]:
    """Count, keeping a checkpoint at each number."""
    if parameters.companion:
        subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    kept = read_json(bench.checkpoint) or {"number": 0, "chain": ""}
    number, chain = kept["number"], kept["chain"]
    while number < parameters.to:
        died = bench.folder / f"died-{number}"
        if number in parameters.kill_at and not died.exists():
            died.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        number, chain = number + 1, hashlib.sha256(f"{chain}{number}".encode()).hexdigest()
        write_json(bench.checkpoint, {"number": number, "chain": chain}, durable=False)
        bench.progress(number / parameters.to, f"{number} of {parameters.to}")
        time.sleep(parameters.pause_s)
        while number == parameters.hold_at and not (bench.folder / "go").exists():
            time.sleep(0.01)
    _come_to_harm(parameters.fail)
    (bench.out / "chain.txt").write_text(chain)
    return {"sentence": f"counted to {number}", "chain": chain}


def _come_to_harm(how: str) -> None:
    if how == "input":
        raise UsageError("to = 7: is no number that can be counted to; take 8")
    if how == "bug":
        raise ZeroDivisionError("of ours")
    if how == "memory":
        raise MemoryError
    if how == "cluster":
        raise SpreadError("piece 1 of 2 is lost")
    if how == "disk":
        raise OSError(28, os.strerror(28))


COUNT = Kind("count", CountParameters, "tests.cnctwin.jobs.counting:count")


def register() -> None:
    """Have this process know the kind."""
    KINDS["count"] = COUNT


def chain_to(number: int) -> str:
    """Return what an uninterrupted count comes to."""
    chain = ""
    for one in range(number):
        chain = hashlib.sha256(f"{chain}{one}".encode()).hexdigest()
    return chain


def checkpoint_of(folder: Path) -> int:
    """Return how far a job in this folder has counted."""
    return int((read_json(folder / "checkpoint.json") or {"number": 0})["number"])


def written(folder: Path) -> str:
    """The result in a job's folder."""
    assert not json.loads((folder / "state.json").read_text())["reason"]
    return (folder / "result/chain.txt").read_text()


if __name__ == "__main__":
    register()
    raise SystemExit(child.main())
