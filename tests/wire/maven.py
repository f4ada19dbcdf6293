"""Servers in Java for tests: fetched and compiled by Maven, once for each state of their sources, and kept in `.cache`."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from functools import lru_cache
from pathlib import Path

import pytest

from tests.recordings import PROJECT

BUILD_S_MAX = 300.0


@lru_cache
def built(here: Path, name: str) -> Path:
    """The folder with `classes` (ours) and `lib` (the server's) of the pom.xml in `here`; skips the test without Maven."""
    for program in ("java", "mvn"):
        if shutil.which(program) is None:
            pytest.skip(f"no {program} on this machine; install the packages default-jdk-headless and maven")
    sources = [here / "pom.xml", *sorted(here.glob("src/**/*.java")), *sorted(here.glob("src/**/*.xml"))]
    digest = hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:16]
    folder = PROJECT / ".cache" / name.lower() / digest
    if not folder.exists():
        _build(here, name, folder)
    return folder


def _build(here: Path, name: str, folder: Path) -> None:
    """Build beside `folder` and rename, so that a folder that is there is whole."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent) as scratch:
        shutil.copy(here / "pom.xml", scratch)
        shutil.copytree(here / "src", Path(scratch) / "src")
        goals = ["compile", "dependency:copy-dependencies", "-DoutputDirectory=target/lib"]
        try:
            command = ["mvn", "-B", "-q", *goals]
            done = subprocess.run(command, cwd=scratch, capture_output=True, text=True, timeout=BUILD_S_MAX, check=False)
            said = done.stdout if done.returncode else ""
        except subprocess.TimeoutExpired:
            said = f"it took more than {BUILD_S_MAX:g} s"
        if said:
            # On the build server a peer that cannot be had is a failure: a skip there would be read by nobody.
            give_up = pytest.fail if os.environ.get("CI") else pytest.skip
            give_up(f"Maven cannot fetch or build {name} (is there a network?): {said.strip()[:300]}")
        if not folder.exists():
            (Path(scratch) / "target").rename(folder)
