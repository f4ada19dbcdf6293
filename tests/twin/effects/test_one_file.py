"""An effect is one file: nothing else in the twin, the processors or the program knows one by its name."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from twin.effects.catalogue import catalogue

ROOT = Path(__file__).parents[3]
APART = ("twin/effects/", "cnctwin/standins/reference_machine/", "cnctwin/blind_check/")
"""The effects themselves, and the machine that shares no code with the twin, with what asks it for an effect."""
EXCEPTIONS = {
    ("twin/identification/axis_parameters.py", "velocity_feedback_delay"): (
        "the identification knows this one and no other: a fit of the constants without it takes an old velocity for missing mass"
    ),
}
"""(file, effect) → why it has to be named there."""
WORD = re.compile(r"[a-z]+(?:_[a-z]+)*")


def sources() -> Iterator[Path]:
    for package in ("twin", "processors", "cnctwin"):
        for path in sorted((ROOT / package).rglob("*.py")):
            if not path.relative_to(ROOT).as_posix().startswith(APART):
                yield path


def imported(node: ast.AST) -> Iterator[str]:
    """Yield the names that an import names, in full."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        yield from (f"{node.module}.{alias.name}" for alias in node.names)


def names_in(text: str) -> set[str]:
    """Effects that a source imports, or names in a literal: alone, as `effect__parameter`, or with its _ in a sentence."""
    if not any(name in text for name in catalogue()):
        return set()
    nodes = list(ast.walk(ast.parse(text)))
    files = {name.split(".")[2] for node in nodes for name in imported(node) if name.startswith("twin.effects.")}
    bare = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    constants = (node for node in nodes if isinstance(node, ast.Constant) and id(node) not in bare)
    literals = {node.value for node in constants if isinstance(node.value, str)}
    words = {word for literal in literals for word in WORD.findall(literal) if "_" in word}
    return (files | words | {literal.partition("__")[0] for literal in literals}) & set(catalogue())


def test_no_other_file_names_an_effect() -> None:
    found = {(p.relative_to(ROOT).as_posix(), name) for p in sources() for name in names_in(p.read_text(encoding="utf-8"))}
    assert found == set(EXCEPTIONS)


def test_a_name_is_seen_in_an_import_a_tuple_an_f_string_a_sentence_and_beside_a_parameter_but_not_in_a_docstring() -> None:
    assert names_in("from twin.effects import gravity, effect") == names_in("import twin.effects.gravity") == {"gravity"}
    assert names_in("from twin.effects.lead_error import EFFECT") == {"lead_error"}
    assert names_in("SLOW = ('gravity', 'wind')") == {"gravity"}
    assert names_in("key = f'presliding__{name}'") == {"presliding"}
    assert names_in("print(f'has lead_error on {axis}')") == {"lead_error"}
    assert names_in("'''gravity'''\nSIZE = 2.0\n'''lead_error'''") == set()
