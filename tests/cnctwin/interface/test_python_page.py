"""docs/reference/python.md shows what is there: each name, attribute and argument in its code."""

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import cnctwin

PAGE = (Path(__file__).parents[3] / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
SECTIONS = {
    "A store": {"store": cnctwin.Store},
    "Run logs": {"run": cnctwin.Run},
    "Simulate": {"done": cnctwin.Simulated, "machine": cnctwin.MachineFile},
    "Diagnose": {"found": cnctwin.Diagnosis},
    "Optimise": {"found": cnctwin.Optimised},
    "A machine's row, live": {"watch": cnctwin.Watch, "row": cnctwin.Row},
}


def code_of(section: str) -> str:
    return re.findall(r"```python\n(.*?)```", PAGE.split(f"\n## {section}\n")[1].split("\n## ")[0], re.S)[0]  # type: ignore[no-any-return]


def attributes(tree: ast.AST) -> Iterator[tuple[str, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            yield node.value.id, node.attr


@pytest.mark.parametrize("section", SECTIONS)
def test_the_code_of_the_page_names_what_there_is(section: str) -> None:
    kinds = SECTIONS[section]
    tree = ast.parse(code_of(section))
    used = set(attributes(tree))
    assert len(used) >= 4
    missing = [f"{name}.{one}" for name, one in used if name in kinds and not hasattr(kinds[name], one)]
    missing += [f"cnctwin.{one}" for name, one in used if name == "cnctwin" and not hasattr(cnctwin, one)]
    assert missing == []
    for call in ast.walk(tree):
        if (
            not isinstance(call, ast.Call)
            or not isinstance(call.func, ast.Attribute)
            or not isinstance(call.func.value, ast.Name)
        ):
            continue
        owner = {**kinds, "cnctwin": cnctwin}.get(call.func.value.id)
        if owner is None:
            continue
        given = [None] * len(call.args) if owner is cnctwin else [None] * (len(call.args) + 1)  # self
        inspect.signature(getattr(owner, call.func.attr)).bind(*given, **{one.arg: None for one in call.keywords if one.arg})


def test_what_the_page_says_of_errors_is_so() -> None:
    rows = re.findall(r"(?m)^\| ((?:`\w+`(?:, )?)+) \|", PAGE.split("\n## Errors\n")[1])
    named = [name for row in rows for name in re.findall(r"`(\w+)`", row)]
    assert {name for name in cnctwin.__all__ if name.endswith("Error")} == {*named, "ApplicationError"}
    usage = named[: named.index("LimitsError")]
    assert [name for name in named if issubclass(getattr(cnctwin, name), cnctwin.UsageError)] == usage
