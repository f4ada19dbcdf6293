"""The examples in docstrings are true: of every module that has any."""

import doctest
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SOURCES = [
    path.relative_to(ROOT)
    for package in ("sparkplug", "twin", "edge", "processors", "cnctwin", "benchmarks")
    for path in sorted((ROOT / package).rglob("*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("source", SOURCES, ids=str)
def test_the_examples_of_a_module_are_true(source: Path) -> None:
    found = doctest.testmod(importlib.import_module(".".join(source.with_suffix("").parts).removesuffix(".__init__")))
    assert (found.failed, found.attempted > 0) == (0, True)
