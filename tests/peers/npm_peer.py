"""The npm packages that ours is tested against, installed once, and Node processes that speak with a test by lines."""

from __future__ import annotations

import hashlib
import json
import os
import queue
import shutil
import subprocess
import tempfile
import threading
from functools import lru_cache
from pathlib import Path
from types import TracebackType
from typing import Any

import pytest

HERE = Path(__file__).parent
CACHE = HERE.parents[1] / ".cache" / "peers"
INSTALL_S_MAX = 180.0
ANSWER_S_MAX = 90.0  # Node itself needs seconds to start beside other tests


@lru_cache(maxsize=1)
def installed_peers() -> Path:
    """The folder with the scripts beside their `node_modules`; skips the test where Node or npm are missing."""
    for program in ("node", "npm"):
        if shutil.which(program) is None:
            pytest.skip(f"no {program} on this machine; install Node.js 18 or newer with npm")
    lock = (HERE / "package-lock.json").read_bytes() + (HERE / "package.json").read_bytes()
    folder = CACHE / hashlib.sha256(lock).hexdigest()[:16]
    if not folder.exists():
        _install(folder)
    for script in HERE.glob("*.mjs"):
        fresh = folder / f"{script.name}.{os.getpid()}"
        shutil.copy(script, fresh)
        fresh.replace(folder / script.name)
    return folder


def _install(folder: Path) -> None:
    """Install beside `folder` and rename, so that a folder that is there is whole."""
    CACHE.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=CACHE) as scratch:
        fresh = Path(scratch) / "fresh"
        fresh.mkdir()
        for name in ("package.json", "package-lock.json"):
            shutil.copy(HERE / name, fresh)
        command = ["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--omit=optional", "--loglevel=error"]
        done = subprocess.run(command, cwd=fresh, capture_output=True, text=True, timeout=INSTALL_S_MAX, check=False)
        if done.returncode:
            # On the build server a peer that cannot be had is a failure: a skip there would be read by nobody.
            give_up = pytest.fail if os.environ.get("CI") else pytest.skip
            give_up(f"npm cannot install the peers: {done.stderr.strip()[-300:]}")
        if not folder.exists():
            fresh.rename(folder)


def _number(digits: str) -> int | float:
    """JavaScript has only floats: above 2^53 it prints as many digits as tell one from the next, and fills up with zeros."""
    return int(digits) if abs(int(digits)) < 1 << 53 else float(digits)


class NodeProcess:
    """A script that runs in Node; its lines are read by a thread, so that waiting for one can end."""

    def __init__(self, script: str, *arguments: str) -> None:
        self._script = script
        self._process = subprocess.Popen(
            ["node", script, *arguments],
            cwd=installed_peers(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
        )
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> NodeProcess:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.kill()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line.strip())
        self._lines.put(None)  # it has ended: who waits is told at once

    def tell(self, line: str) -> None:
        """Write a line to the script."""
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")

    def hear(self, timeout_s: float = ANSWER_S_MAX) -> str:
        """The next line of the script."""
        try:
            line = self._lines.get(timeout=timeout_s)
        except queue.Empty:
            raise TimeoutError(f"{self._script} said nothing for {timeout_s} s, and runs") from None
        if line is None:
            raise EOFError(f"{self._script} has ended with exit code {self._process.wait()}")
        return line

    def ask(self, line: str) -> Any:
        """Write a line and read its answer."""
        self.tell(line)
        return json.loads(self.hear(), parse_int=_number)

    def kill(self) -> None:
        """End it as a power cut does (-9)."""
        self._process.kill()
        self._process.wait()
        self._reader.join()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            pipe.close()
