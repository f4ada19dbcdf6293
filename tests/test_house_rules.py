"""The rules of the house that no linter knows (CONTRIBUTING.md)."""

import ast
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import LONG

ROOT = Path(__file__).parent.parent
PACKAGES = ("sparkplug", "twin", "edge", "processors", "cnctwin")
LINES_MAX = 400
FUNCTION_LINES_MAX = 70
VAGUE_NAMES = {"helpers", "helper", "utils", "util", "common", "commons", "manager", "managers", "misc", "tools"}
SPREADS = ROOT / "cnctwin" / "jobs" / "spread.py"
"""The one that may import joblib: between our own processes, and with a name and a text only (docs/decisions/0014-spread.md)."""
SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))


def tracked() -> list[Path]:
    """The files of the project; everything but what git ignores. Without git or its records, what lies in no hidden folder."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    if shutil.which("git"):
        listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout.split("\n")
        if files := [ROOT / name for name in listed if name and (ROOT / name).is_file()]:
            return files
    made = {"__pycache__", "node_modules", "dist"}
    names = [(path, set(path.relative_to(ROOT).parent.parts)) for path in ROOT.rglob("*") if path.is_file()]
    return [
        path for path, folders in names if not folders & made and not any(folder.startswith(".") for folder in folders - {".ci"})
    ]


def functions(tree: ast.AST) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_file_is_one_noun_that_can_be_read_in_one_go(path: Path) -> None:
    source = path.read_text()
    assert path.stem not in VAGUE_NAMES, f"{path.name} says nothing of what is in it"
    assert source.count("\n") <= LINES_MAX, "this file wants to be two"
    tree = ast.parse(source)
    if tree.body:
        assert ast.get_docstring(tree), "a file begins with what it is"
    for function in functions(tree):
        length = (function.end_lineno or 0) - function.lineno + 1
        assert length <= FUNCTION_LINES_MAX, f"{function.name} is {length} lines long"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_nothing_is_unpickled_evaluated_or_left_unbounded(path: Path) -> None:
    source = path.read_text()
    unpickling = "pickle|marshal|shelve|dill|joblib|cloudpickle"
    if path == SPREADS:
        unpickling = unpickling.replace("joblib|", "")
    assert not re.search(rf"^\s*(import|from) ({unpickling})\b", source, re.M)
    assert "allow_pickle=True" not in source
    assert not re.search(r"(?<![\w.])(eval|exec)\(", source)
    assert not re.search(r"queue\.(Queue|LifoQueue)\(\)", source), "a queue needs a limit"


def test_tests_mirror_the_tree() -> None:
    tests = ROOT / "tests"
    folders = {path.parent.relative_to(tests) for room in (*PACKAGES, "benchmarks") for path in (tests / room).rglob("test_*.py")}
    assert {Path(package) for package in PACKAGES} <= folders
    conformance = Path("sparkplug/conformance")  # follows the chapters of the specification
    assert {folder for folder in folders if not any((ROOT / folder).glob("*.py"))} == {conformance}


def test_the_files_that_begin_first_are_there() -> None:
    assert [name for name in LONG if not (ROOT / "tests" / name).exists()] == []


def test_the_arrows_between_packages_hold() -> None:
    done = subprocess.run([Path(sys.executable).with_name("lint-imports")], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_the_lock_pins_by_hash_and_names_no_address() -> None:
    lock = (ROOT / "requirements.lock").read_text()
    pinned = re.findall(r"^[a-z0-9._-]+==\S+", lock, re.M | re.I)
    assert len(pinned) > 20
    assert lock.count("--hash=sha256:") >= len(pinned)
    assert "://" not in lock


def test_nothing_names_a_machine_or_a_registry() -> None:
    own_root = str(ROOT.parent)
    registries = re.compile(r"https?://[\w.-]*(pypi|pythonhosted|npmjs|crates\.io|proxy\.golang|repo1?\.maven)[\w.-]*")
    files = tracked()
    assert ROOT / "README.md" in files
    for path in files:
        try:
            text = path.read_text()
        except UnicodeDecodeError:
            continue
        assert not registries.search(text), path
        if len(own_root) > 4:
            assert own_root + "/" not in text, path
