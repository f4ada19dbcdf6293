"""The reference machine shares no code with the twin: it imports nothing of ours but itself."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[4] / "cnctwin" / "standins" / "reference_machine"
OURS = ("twin", "cnctwin", "sparkplug", "edge", "processors")
SOURCES = sorted(FOLDER.rglob("*.py"))


def imported(source: str) -> Iterator[str]:
    """Modules that a source names in an import, relative ones and those by name at run time among them."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield "cnctwin." * (node.level > 0) + (node.module or "")
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute | ast.Name):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else node.func.id
            if name in ("__import__", "import_module"):
                yield "twin, by name"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.name)
def test_nothing_of_the_twin_is_imported(path: Path) -> None:
    ours = [name for name in imported(path.read_text()) if name.split(".")[0].split(",")[0] in OURS]
    assert all(name.startswith("cnctwin.standins.reference_machine") for name in ours), ours


def test_there_is_something_to_look_at() -> None:
    assert len(SOURCES) > 8


@pytest.mark.parametrize(
    "source", ["import twin.servo", "from twin import thermal", "from importlib import import_module\nimport_module(name)"]
)
def test_an_import_of_the_twin_would_be_seen(source: str) -> None:
    assert any(name.startswith("twin") for name in imported(source))
