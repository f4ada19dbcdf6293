"""The rules of the house that no linter knows (CONTRIBUTING.md)."""

import ast
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping, Set
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
SCRIPTS = ROOT / "cnctwin" / "page" / "web" / "js"
FOLDER_FILES_MAX = 30
LONG_FOLDERS = {ROOT / "twin" / "effects"}
"""One file for each effect, as many as there are."""
ROOT_OF_THE_PROGRAM = {"__init__.py", "__main__.py", "cli.py", "errors.py"}


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


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(path: Path, modules: Set[str]) -> set[str]:
    """The modules that a file imports anywhere in it: at its top, in a function, for its types only."""
    name = module_name(path)
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            found |= {inner if (inner := f"{base}.{alias.name}") in modules else base for alias in node.names}
    return (found & modules) - {name}


def imported_scripts(path: Path) -> set[str]:
    """The ES modules of ours that a script names: in an import, in an export from another, in an import when it is needed."""
    named = re.findall(r"""\b(?:from|import)\s*\(?\s*["'](\.[^"']+)["']""", path.read_text())
    return {(path.parent / one).resolve().relative_to(SCRIPTS).as_posix() for one in named}


def circles(graph: Mapping[str, Set[str]]) -> list[list[str]]:
    """The strongly connected components of more than one node (Tarjan 1972), without recursion."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found = []
    for root in graph:
        work = [(root, iter(sorted(graph[root])))] if root not in index else []
        while work:
            node, onward = work[-1]
            if node not in index:
                index[node] = low[node] = len(index)
                stack.append(node)
            for other in onward:
                if other not in index:
                    work.append((other, iter(sorted(graph[other]))))
                    break
                if other in stack:
                    low[node] = min(low[node], index[other])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[node])
                if low[node] == index[node]:
                    component = stack[stack.index(node) :]
                    del stack[stack.index(node) :]
                    if len(component) > 1:
                        found.append(sorted(component))
    return found


def test_no_module_imports_itself_in_a_circle() -> None:
    assert circles({"a": {"b"}, "b": {"c", "d"}, "c": {"b"}, "d": {"e"}, "e": {"d"}, "f": set()}) == [["d", "e"], ["b", "c"]]
    modules = {module_name(path): path for path in SOURCES}
    graph = {name: imported(path, modules.keys()) for name, path in modules.items()}
    assert "cnctwin.batch.diagnosis" in graph["cnctwin.jobs.work"], "an import in a function counts"
    assert sum(map(len, graph.values())) > 2000
    assert circles(graph) == []


def test_no_script_of_the_page_imports_itself_in_a_circle() -> None:
    graph = {path.relative_to(SCRIPTS).as_posix(): imported_scripts(path) for path in SCRIPTS.rglob("*.js")}
    assert "views/diagnosis.js" in graph["views/gap.js"]
    assert {one for others in graph.values() for one in others} <= graph.keys()
    assert circles(graph) == []


def test_no_folder_is_too_long_to_be_seen_at_once() -> None:
    folders = {path.parent for name in (*PACKAGES, "tests", "benchmarks") for path in (ROOT / name).rglob("*.py")}
    counts = {str(folder.relative_to(ROOT)): len(list(folder.glob("*.py"))) for folder in folders - LONG_FOLDERS}
    assert {folder: count for folder, count in counts.items() if count > FOLDER_FILES_MAX} == {}


def test_the_root_of_the_program_holds_its_entry_point_and_little_else() -> None:
    assert {path.name for path in (ROOT / "cnctwin").glob("*.py")} == ROOT_OF_THE_PROGRAM


@pytest.mark.parametrize("package", PACKAGES)
def test_every_room_says_what_it_is(package: str) -> None:
    rooms = {path.parent for path in (ROOT / package).rglob("*.py")}
    rooms |= {above for room in rooms for above in room.parents if above.is_relative_to(ROOT / package)}
    silent = [
        str(room.relative_to(ROOT))
        for room in sorted(rooms)
        if not (room / "__init__.py").is_file() or not ast.get_docstring(ast.parse((room / "__init__.py").read_text()))
    ]
    assert silent == []


DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
NO_FILES = {"processors/chip_load.py", "processors/chip_load.toml", "cnctwin/alerts/"}
"""An example that docs/how-to/add-a-processor.md shows how to write, and a topic."""


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_file_that_a_document_names_is_there(document: Path) -> None:
    text = document.read_text()
    links = re.findall(r"\]\((?!\w+:)([^)#\s]+)(?:#[^)\s]*)?\)", text)
    missing = [link for link in links if not (document.parent / link).exists()]
    tops = "|".join((*PACKAGES, "tests", "benchmarks", "scripts", "deploy", "docs"))
    named = re.findall(rf"`((?:{tops})/[\w./<>-]*?(?:\.(?:py|js|css|toml|md|nc|c|xml|html)|/))(?=[`:#\s])", text)
    patterns = {name: re.sub(r"<\w+>", "*", name) for name in named if name not in NO_FILES}
    missing += [name for name, pattern in patterns.items() if not any(ROOT.glob(pattern))]
    assert missing == []


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
