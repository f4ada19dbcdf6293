"""The part of XPath that clients use in `path=`: steps, `//`, `*`, attribute tests with and, or, and unions.

`//Axes//Linear[@name="X"]`, `//DataItem[@type="POSITION" or @category="CONDITION"]`, `//Path|//Controller`. The
answer is a set of data items: those that match, and all below a component that matches.
"""

import re
from collections.abc import Iterable
from typing import NamedTuple
from xml.etree import ElementTree

from cnctwin.standins.mtconnect_agent.xml_text import local_name

PATH_CHARS_MAX = 2_000

_STEP = re.compile(r"(//?)(?:\w+:)?(\*|\.|[A-Za-z_][\w.-]*)((?:\[[^\]]*\])*)")
_TEST = re.compile(r"""\s*@(\w+)\s*=\s*("[^"]*"|'[^']*')\s*""")


class PathError(ValueError):
    """The path isn't of the supported form."""


class Step(NamedTuple):
    """One step: how deep it looks, the element's name, and for each predicate its alternatives of attribute tests."""

    is_deep: bool
    name: str
    predicates: tuple[tuple[dict[str, str], ...], ...]


def parse_path(text: str) -> list[list[Step]]:
    """Take a path apart.

    >>> parse_path('//Linear[@name="X"]')
    [[Step(is_deep=True, name='Linear', predicates=(({'name': 'X'},),))]]
    """
    if len(text) > PATH_CHARS_MAX:
        raise PathError(f"longer than {PATH_CHARS_MAX} characters")
    return [_parse_steps(part.strip()) for part in _split_unions(text)]


def matching_ids(path: list[list[Step]], devices: Iterable[ElementTree.Element]) -> set[str]:
    """Return the ids of the data items that a path selects."""
    root = ElementTree.Element("MTConnectDevices")
    ElementTree.SubElement(root, "Devices").extend(devices)
    outside = ElementTree.Element("document")
    outside.append(root)
    selected = [element for steps in path for element in _select(steps, outside)]
    return {
        item.get("id", "")
        for element in selected
        for item in element.iter()
        if isinstance(item.tag, str) and local_name(item.tag) == "DataItem"
    }


def _split_unions(text: str) -> list[str]:
    parts, depth = [""], 0
    for char in text:
        depth += (char == "[") - (char == "]")
        if char == "|" and depth == 0:
            parts.append("")
        else:
            parts[-1] += char
    return parts


def _parse_steps(text: str) -> list[Step]:
    steps: list[Step] = []
    position = 0
    while position < len(text):
        match = _STEP.match(text, position)
        if match is None:
            raise PathError(f"not understood from {text[position:]!r} on")
        predicates = tuple(_parse_predicate(p) for p in re.findall(r"\[([^\]]*)\]", match[3]))
        steps.append(Step(match[1] == "//", match[2], predicates))
        position = match.end()
    if not steps:
        raise PathError("it is empty")
    return steps


def _parse_predicate(text: str) -> tuple[dict[str, str], ...]:
    alternatives: list[dict[str, str]] = [{}]
    position = 0
    while True:
        match = _TEST.match(text, position)
        if match is None:
            raise PathError(f"only attribute tests are supported, not [{text}]")
        alternatives[-1][match[1]] = match[2][1:-1]
        rest = text[match.end() :]
        if not rest:
            return tuple(alternatives)
        word = rest.split(None, 1)[0]
        if word not in ("and", "or"):
            raise PathError(f"only `and` and `or` join tests, not {rest!r}")
        if word == "or":
            alternatives.append({})
        position = match.end() + rest.index(word) + len(word)


def _select(steps: list[Step], root: ElementTree.Element) -> list[ElementTree.Element]:
    current = [root]
    for step in steps:
        found: dict[int, ElementTree.Element] = {}
        for element in current:
            if step.name == ".":
                candidates: Iterable[ElementTree.Element] = element.iter() if step.is_deep else [element]
            else:
                candidates = (c for c in element.iter() if c is not element) if step.is_deep else iter(element)
            found |= {id(c): c for c in candidates if _matches(step, c)}
        current = list(found.values())
    return current


def _matches(step: Step, element: ElementTree.Element) -> bool:
    if not isinstance(element.tag, str) or step.name not in ("*", ".", local_name(element.tag)):
        return False
    return all(
        any(all(element.get(n) == v for n, v in tests.items()) for tests in alternatives) for alternatives in step.predicates
    )
