"""Programs that are built once from the Go module proxy, each pinned, for tests of files that only their own reader reads."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.recordings import PROJECT

CACHE = PROJECT / ".cache" / "go"
BUILD_S_MAX = 300.0
KUSTOMIZE = "sigs.k8s.io/kustomize/kustomize/v5@v5.7.1"
COMPOSE = "github.com/compose-spec/compose-go/v2/cmd@v2.9.1"
"""The reader that docker compose itself has: prints the model that several files make together."""


def built(module: str) -> Path:
    """The program of a module; skips the test where it cannot be had."""
    folder = CACHE / module.replace("/", "_")
    if not folder.exists():
        if shutil.which("go") is None:
            pytest.skip("no go on this machine; install the package golang, 1.23 or newer")
        _build(module, folder)
    return next(path for path in folder.iterdir() if os.access(path, os.X_OK))


def _build(module: str, folder: Path) -> None:
    """Build beside `folder` and rename, so that a folder that is there is whole."""
    scratch = folder.with_name(f"{folder.name}.{os.getpid()}")
    scratch.mkdir(parents=True)
    try:
        done = subprocess.run(
            ["go", "install", module],
            env={**os.environ, "GOBIN": str(scratch), "GOFLAGS": "-p=2"},
            capture_output=True,
            text=True,
            timeout=BUILD_S_MAX,
            check=False,
        )
        said = done.stderr.strip()[-300:] if done.returncode else ""
    except subprocess.TimeoutExpired:
        said = f"it took more than {BUILD_S_MAX:g} s"
    if said:
        shutil.rmtree(scratch)
        pytest.skip(f"go cannot fetch or build {module} (is there a network? is it new enough?): {said}")
    if folder.exists():  # another worker was faster
        shutil.rmtree(scratch)
    else:
        scratch.rename(folder)
