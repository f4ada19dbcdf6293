"""Faults of a configuration file: all of them at once, one line each, with the nearest right name.

The models are pydantic's; this module knows of them only that a model has `model_fields`, each with an `annotation` and perhaps
an `alias`, and that a fault has a `loc`, a `type`, a `msg` and an `input`.
"""

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, get_args, get_origin

FAULTS_MAX = 50
NAMES_MAX = 16
VALUE_CHARACTERS_MAX = 60
_CHOICE = re.compile(r"constrained-|function-|(tuple|list|dict|literal)\[")
"""Parts of a place that no file has: pydantic's names of what a value may be."""
_SAID = (("Value error, ", ""), ("Assertion failed, ", ""), ("Input should", "should"))


def faults_of(
    faults: Iterable[Mapping[str, Any]], model: Any, table: str = "", shown: Callable[[Any], str] | None = repr
) -> list[str]:
    """Return a line for each fault that pydantic found: names that are not known first, since a missing one may be one misspelt.

    table: what stands before each key, as `thermal.` or `[thermal] `; shown: how a value is written, None = no value is shown

    >>> class Spindle:
    ...     model_fields = {"power_kw": None, "rpm_max": None}
    >>> extra = {"loc": ("power_kv",), "type": "extra_forbidden", "msg": "", "input": 11}
    >>> wrong = {"loc": ("rpm_max",), "type": "greater_than", "msg": "Input should be greater than 0", "input": -1}
    >>> faults_of([wrong, extra], Spindle, "spindle.")
    ['spindle.power_kv is not known; did you mean power_kw?', 'spindle.rpm_max = -1: should be greater than 0']
    """
    in_order = sorted(faults, key=lambda fault: fault["type"] != "extra_forbidden")
    lines = [line for fault in in_order for line in _lines(fault, model, table, shown)]
    return list(dict.fromkeys(lines))


def unknown(what: str, name: str, known: Collection[str]) -> str:
    """Return the line for a name that is not known; what: the name as the file writes it.

    >>> unknown("[thermel]", "thermel", ["thermal", "gap"]), unknown("[x]", "x", ["thermal", "gap"])
    ('[thermel] is not known; did you mean thermal?', '[x] is not known; known are thermal, gap')
    """
    if near := get_close_matches(name, list(known), 1, 0.6):
        return f"{what} is not known; did you mean {near[0]}?"
    more = ", …" if len(known) > NAMES_MAX else ""
    listed = ", ".join(list(known)[:NAMES_MAX])
    return f"{what} is not known; " + (f"known are {listed}{more}" if listed else "remove it")


def report(source: object, faults: Sequence[str], see: str = "") -> str:
    """Return what an error says of a file: its fault, or all of them, each on a line of its own.

    see: where what is right is described, as `docs/machine.md`

    >>> print(report("vmc.toml", ["a is missing", "b is missing"], "docs/machine.md"))
    vmc.toml: 2 faults; see docs/machine.md
      a is missing
      b is missing
    >>> report("vmc.toml", ["a is missing"])
    'vmc.toml: a is missing'
    """
    after = f"; see {see}" if see else ""
    if len(faults) == 1:
        return f"{source}: {faults[0]}{' See ' + see if see and faults[0].endswith('?') else after}"
    listed = [*faults[:FAULTS_MAX], *([f"and {len(faults) - FAULTS_MAX} more"] if len(faults) > FAULTS_MAX else [])]
    return "\n  ".join([f"{source}: {len(faults)} faults{after}", *listed])


def _lines(fault: Mapping[str, Any], model: Any, table: str, shown: Callable[[Any], str] | None) -> Iterator[str]:
    place = tuple(part for part in fault["loc"] if not _CHOICE.match(str(part)))
    key = (table + ".".join(map(str, place))).rstrip(". ")
    if fault["type"] == "extra_forbidden":
        yield unknown(key, str(place[-1]), sorted(_names_at(model, place[:-1])))
        return
    if fault["type"] == "missing":
        yield f"{key} is missing"
        return
    if fault["type"] in ("union_tag_not_found", "union_tag_invalid"):  # pydantic's `ctx` has its words in quotes
        told = fault["ctx"]
        by = f"{key}.{str(told['discriminator']).strip(chr(39))}"
        known = [tag.strip("' ") for tag in str(told.get("expected_tags", "")).split(",")]
        tag = str(told.get("tag", ""))
        yield f"{by} is missing" if fault["type"] == "union_tag_not_found" else unknown(f"{by} = {_short(repr(tag))}", tag, known)
        return
    said = str(fault["msg"])
    for before, after in _SAID:
        said = said.replace(before, after)
    said = re.sub(r"a valid dictionary( or instance of \w+)?", "a table", said)
    value = fault.get("input")
    is_shown = "input" in fault and place and isinstance(value, str | int | float | bool | None)
    text = f" = {_short(shown(value))}" if is_shown and shown is not None else ""
    for line in said.split("\n"):
        yield f"{key}{text}: {line}" if place or table.endswith(".") else f"{table}{line}"


def _short(text: str) -> str:
    return text if len(text) <= VALUE_CHARACTERS_MAX else f"{text[:VALUE_CHARACTERS_MAX]}…"


def _names_at(model: Any, place: Sequence[Any]) -> set[str]:
    """Return the names that a table may have at a place: of all models that can stand there."""
    kinds = [model]
    for part in place:
        kinds = [inner for kind in kinds for inner in _inside(kind, str(part))]
    return {
        getattr(field, "alias", None) or name
        for kind in kinds
        for one in _models(kind)
        for name, field in one.model_fields.items()
    }


def _models(kind: Any) -> Iterator[Any]:
    """Yield the models that an annotation holds, whatever is around them."""
    if hasattr(kind, "model_fields"):
        yield kind
    else:
        for inner in get_args(kind):
            yield from _models(inner)


def _inside(kind: Any, part: str) -> Iterator[Any]:
    """Yield the annotations below a name or number: a field's, or those of a mapping, a list or a choice."""
    if hasattr(kind, "model_fields"):
        if (field := _field(kind, part)) is not None:
            yield field.annotation
        elif (root := kind.model_fields.get("root")) is not None:  # a model around one mapping or list
            yield from _inside(root.annotation, part)
        return
    origin, inner = get_origin(kind), get_args(kind)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        yield inner[1]
    elif isinstance(origin, type) and issubclass(origin, Sequence):
        yield inner[0]
    elif chosen := [one for one in inner if _is_told_by(one, part)]:
        yield from chosen
    else:
        for one in inner:
            yield from _inside(one, part)


def _is_told_by(model: Any, word: str) -> bool:
    """Return True where a model is the one of a choice that this word tells, as `kind = "webhook"`."""
    return any(word in get_args(field.annotation) for field in getattr(model, "model_fields", {}).values())


def _field(model: Any, part: str) -> Any:
    found = model.model_fields.get(part)
    return found or next((one for one in model.model_fields.values() if getattr(one, "alias", None) == part), None)
