"""The habits of language that can be checked: see CONTRIBUTING.md. Tests are left out, whose names are their sentences."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.test_house_rules import tracked

ROOT = Path(__file__).parents[1]
FRAGMENT = re.compile(r"(Of|What|Whether|How|Where|Who|Whose)\b")
"""A docstring says what the thing is or does; one that begins so has no verb of its own."""
HABITS = re.compile(r"\b([Hh]as not got|[Hh]ave not got|[Hh]ad not got|[Aa]new)\b")
SOURCES = [path for path in tracked() if path.suffix == ".py" and path.relative_to(ROOT).parts[0] != "tests"]
TEXTS = [path for path in tracked() if path.suffix in {".py", ".md", ".toml", ".js", ".html", ".css"} and path != Path(__file__)]
NAME = re.compile(r"^\s*(def anew|anew = |ANEW = )|\(anew[,)]|as anew:|, anew( =|\))|\*anew\)|\{ANEW\}")


def fragments(source: str) -> Iterator[str]:
    """Yield the docstrings that begin as a fragment does, of constants too, each by its line and first words."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            text = node.value.value.strip()
            if FRAGMENT.match(text):
                yield f"{node.lineno}: {text[:60]}"


def test_a_fragment_is_found() -> None:
    source = (
        '"""What a thing is."""\nPART = 0.1\n"""Of a thing."""\ndef f():\n    """How it is."""\ndef g():\n    """Return it."""\n'
    )
    assert list(fragments(source)) == ["1: What a thing is.", "3: Of a thing.", "5: How it is."]


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_docstring_says_what_the_thing_is_or_does(path: Path) -> None:
    assert list(fragments(path.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_text_has_none_of_the_habits(path: Path) -> None:
    lines = path.read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if HABITS.search(line) and not NAME.search(line)] == []
