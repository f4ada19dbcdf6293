"""The npm packages that ours is tested against, installed once, and Node processes that speak with a test by lines."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest

from tests.peers.process import PeerProcess

HERE = Path(__file__).parent
CACHE = HERE.parents[1] / ".cache" / "peers"
INSTALL_S_MAX = 180.0


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


class NodeProcess(PeerProcess):
    """A script that runs in Node."""

    def __init__(self, script: str, *arguments: str) -> None:
        super().__init__(["node", script, *arguments], installed_peers())

    def __enter__(self) -> NodeProcess:
        return self

    def ask(self, line: str) -> Any:
        """Write a line and read its answer."""
        self.tell(line)
        return json.loads(self.hear(), parse_int=_number)
