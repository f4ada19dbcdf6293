"""The peers' programs, each fetched in exact versions with checksums and compiled once, into a folder under `.cache/peers` that
is named by its sources. A test whose toolchain or download is missing skips, saying which.
"""

from __future__ import annotations

import fcntl
import hashlib
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import pytest

from tests.depth import IS_FULL
from tests.peers.npm_peer import installed_peers

HERE = Path(__file__).parent
CACHE = HERE.parents[1] / ".cache" / "peers"
BUILD_S_MAX = 540.0


def _pysparkplug(scratch: Path) -> None:
    _run([sys.executable, "-m", "venv", "venv"], scratch)
    pip = ["venv/bin/python", "-m", "pip", "install", "-q", "--disable-pip-version-check"]
    _run([*pip, "--require-hashes", "-r", "requirements.txt"], scratch)


def _srad(scratch: Path) -> None:
    """crates.lock is a Cargo.lock that does not say where its crates come from: from where this machine's cargo has its own."""
    lock = scratch / "Cargo.lock"
    _run(["cargo", "generate-lockfile", "--quiet"], scratch)
    source = next(line for line in lock.read_text().splitlines() if line.startswith("source = "))
    lock.write_text(re.sub(r"(?m)^(?=checksum = )", lambda _: f"{source}\n", (scratch / "crates.lock").read_text()))
    _run(["cargo", "build", "--locked", "--quiet"], scratch)
    for left in ("deps", "build", "incremental", ".fingerprint"):
        shutil.rmtree(scratch / "target" / "debug" / left, ignore_errors=True)


def _tahu(scratch: Path) -> None:
    (scratch / "lib").mkdir()
    _run(["mvn", "-B", "-q", "validate"], scratch)
    wanted = dict(reversed(line.split()) for line in (scratch / "checksums").read_text().splitlines())
    for jar in sorted((scratch / "lib").iterdir()):
        found = hashlib.sha256(jar.read_bytes()).hexdigest()
        assert wanted.get(jar.name) == found, f"{jar.name} has the checksum {found}, which is not in tests/peers/tahu/checksums"
    sources = sorted(source.name for source in scratch.glob("*.java"))
    subprocess.run(["javac", "-nowarn", "-d", "classes", "-cp", "lib/*", *sources], cwd=scratch, check=True)


BUILDS: dict[str, tuple[tuple[str, ...], Callable[[Path], None]]] = {
    "pysparkplug": ((), _pysparkplug),
    "srad": (("cargo",), _srad),
    "tahu": (("java", "javac", "mvn"), _tahu),
}
PACKAGES = {"cargo": "rustc and cargo 1.75 or newer", "mvn": "the package maven", "java": "the package default-jdk-headless"}
COMMANDS = {
    "pysparkplug": ("venv/bin/python", "peer.py"),
    "srad": ("target/debug/srad-peer",),
    "tahu": ("java", "-Xmx192m", "-XX:+UseSerialGC", "-XX:TieredStopAtLevel=1", "-cp", "classes:lib/*", "Peer"),
}
SLOW_TO_BUILD = frozenset({"srad"})
"""It takes a minute on two cores that have nothing else to do: built by `scripts/peers` and CNCTWIN_FULL=1, else used where it
is there."""


def command_of(peer: str) -> tuple[tuple[str, ...], Path]:
    """Return the command of a peer's program, without its arguments, and the folder that it runs in."""
    if peer == "sparkplug-client":
        return ("node", "edge.mjs"), installed_peers()
    folder = built(peer)
    first, *rest = COMMANDS[peer]
    return (str(folder / first) if "/" in first else first, *rest), folder


@cache
def built(peer: str) -> Path:
    """Return the folder with a peer's program; skip the test where it cannot be made."""
    programs, build = BUILDS[peer]
    for program in programs:
        if shutil.which(program) is None:
            pytest.skip(f"no {program} on this machine for the peer {peer}; install {PACKAGES.get(program, program)}")
    sources = [path for path in sorted((HERE / peer).rglob("*")) if path.is_file() and "__pycache__" not in path.parts]
    folder = CACHE / f"{peer}-{hashlib.sha256(b''.join(path.read_bytes() for path in sources)).hexdigest()[:16]}"
    if not folder.exists():
        if peer in SLOW_TO_BUILD and not IS_FULL:
            pytest.skip(f"the peer {peer} is not built yet; run scripts/peers, or set CNCTWIN_FULL=1")
        _build(peer, folder, build)
    return folder


def _build(peer: str, folder: Path, build: Callable[[Path], None]) -> None:
    """Build beside `folder` and rename, so that a folder that is there is whole; of several workers, one builds."""
    CACHE.mkdir(parents=True, exist_ok=True)
    with (CACHE / f"{peer}.lock").open("w") as lock, tempfile.TemporaryDirectory(dir=CACHE) as home:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if folder.exists():
            return
        scratch = Path(home) / "fresh"
        shutil.copytree(HERE / peer, scratch)
        build(scratch)
        scratch.rename(folder)


def _run(command: Sequence[str], folder: Path) -> None:
    """Run a command that fetches; skip the test where it fails."""
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=BUILD_S_MAX, check=False)
        said = (done.stderr or done.stdout).strip()[-300:] if done.returncode else ""
    except subprocess.TimeoutExpired:
        said = f"it took more than {BUILD_S_MAX:g} s"
    if said:
        pytest.skip(f"{' '.join(command)[:80]} cannot fetch or build the peer (is there a network?): {said}")
