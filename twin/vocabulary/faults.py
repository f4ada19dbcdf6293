"""Faults of a configuration file: all of them at once, one line each, with the nearest right name.

The models are pydantic's; this module knows of them only that a model has `model_fields`, each with an `annotation` and perhaps
an `alias`, and that a fault has a `loc`, a `type`, a `msg` and an `input`.
"""

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, get_args, get_origin

FAULTS_MAX = 50
CLOSE = 0.6
"""The similarity from which on a name is taken for a misspelt one."""
NAMES_MAX = 16
VALUE_CHARACTERS_MAX = 60
_CHOICE = re.compile(r"constrained-|function-|(tuple|list|dict|literal)\[")
"""Parts of a place that no file has: pydantic's names of what a value may be."""
_SAID = (("Value error, ", ""), ("Assertion failed, ", ""), ("Input should", "should"))
_NO_SCALAR = {"float_type", "int_type", "bool_type", "string_type"}
_NO_CONTAINER = {"tuple_type", "list_type", "dict_type", "model_type", "model_attributes_type"}
"""Types of faults that say only that a value is of another kind."""
_WORDS: dict[str, Callable[[Mapping[str, Any]], str]] = {
    "string_type": lambda _: "is no text; put it in quotes",
    "string_too_short": lambda c: "is empty; write what it should be" if c["min_length"] == 1 else _too_short(c, "characters"),
    "string_pattern_mismatch": lambda c: f"does not match the pattern {c['pattern']}",
    "string_too_long": lambda c: f"is longer than {c['max_length']} characters; shorten it",
    "int_type": lambda _: "is no whole number",
    "int_parsing": lambda _: "is no whole number; write one without quotes",
    "int_from_float": lambda _: "is no whole number",
    "float_type": lambda _: "is no number",
    "float_parsing": lambda _: "is no number; write one without quotes",
    "finite_number": lambda _: "is not a finite number",
    "bool_type": lambda _: "is neither true nor false",
    "bool_parsing": lambda _: "is neither true nor false",
    "greater_than": lambda c: f"must be above {c['gt']:g}",
    "greater_than_equal": lambda c: f"must be {c['ge']:g} or more",
    "less_than": lambda c: f"must be below {c['lt']:g}",
    "less_than_equal": lambda c: f"must be {c['le']:g} or less",
    "literal_error": lambda c: f"must be {c['expected']}",
    "enum": lambda c: f"must be {c['expected']}",
    "dict_type": lambda _: "must be a table",
    "model_type": lambda _: "must be a table",
    "model_attributes_type": lambda _: "must be a table",
    "list_type": lambda _: "must be a list",
    "tuple_type": lambda _: "must be a list",
    "too_short": lambda c: _too_short(c, "entries"),
    "too_long": lambda c: f"has {c['actual_length']} entries; the limit is {c['max_length']}",
}
"""Words for a fault by pydantic's name of it, filled from its `ctx`."""


def faults_of(
    faults: Iterable[Mapping[str, Any]], model: Any, table: str = "", shown: Callable[[Any], str] | None = repr
) -> list[str]:
    """Return a line for each fault that pydantic found: names that are not known first, since a missing one may be one misspelt.

    table: what stands before each key, as `thermal.` or `[thermal] `; shown: how a value is written, None = no value is shown

    >>> class Spindle:
    ...     model_fields = {"power_kw": None, "rpm_max": None}
    >>> extra = {"loc": ("power_kv",), "type": "extra_forbidden", "msg": "", "input": 11}
    >>> wrong = {"loc": ("rpm_max",), "type": "greater_than", "msg": "", "ctx": {"gt": 0}, "input": -1}
    >>> faults_of([wrong, extra], Spindle, "spindle.")
    ['spindle.power_kv is not known; did you mean power_kw?', 'spindle.rpm_max = -1: must be above 0']
    """
    in_order = _without_followers(sorted(faults, key=lambda fault: fault["type"] != "extra_forbidden"), model)
    lines = [line for fault in in_order for line in _lines(fault, model, table, shown)]
    return list(dict.fromkeys(lines))


def unknown(what: str, name: str, known: Collection[str]) -> str:
    """Return the line for a name that is not known; what: the name as the file writes it.

    >>> unknown("[thermel]", "thermel", ["thermal", "gap"]), unknown("[x]", "x", ["thermal", "gap"])
    ('[thermel] is not known; did you mean thermal?', '[x] is not known; known are thermal, gap')
    """
    if near := get_close_matches(name, list(known), 1, CLOSE):
        return f"{what} is not known; did you mean {near[0]}?"
    more = ", …" if len(known) > NAMES_MAX else ""
    listed = ", ".join(list(known)[:NAMES_MAX])
    return f"{what} is not known; " + (f"known are {listed}{more}" if listed else "remove it")


def report(source: object, faults: Sequence[str], see: str = "") -> str:
    """Return what an error says of a file: its fault, or all of them, each on a line of its own.

    see: where what is right is described, as `docs/reference/machine.md`

    >>> print(report("vmc.toml", ["a is missing", "b is missing"], "docs/reference/machine.md"))
    vmc.toml: 2 faults; see docs/reference/machine.md
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


def _without_followers(faults: Sequence[Mapping[str, Any]], model: Any) -> list[Mapping[str, Any]]:
    """Return the faults without those that only follow from another one.

    A key is not missing where a misspelt one stands for it, and a value that fails in one branch of a choice need not be told
    that it is none of the other branches' kind.
    """
    places = [_place(fault) for fault in faults]
    meant = {
        (*place[:-1], near[0])
        for fault, place in zip(faults, places, strict=True)
        if fault["type"] == "extra_forbidden"
        and (near := get_close_matches(str(place[-1]), sorted(_names_at(model, place[:-1])), 1, CLOSE))
    }

    def follows(at: int) -> bool:
        kind, place = faults[at]["type"], places[at]
        if kind == "missing":
            return place in meant
        is_inside = isinstance(faults[at].get("input"), list | tuple | dict)
        others = [
            other["type"]
            for number, other in enumerate(faults)
            if number != at and places[number][: len(place)] == place and (is_inside or places[number] == place)
        ]
        own = _NO_SCALAR if is_inside else _NO_CONTAINER
        return kind in own and any(other not in own for other in others)

    return [fault for at, fault in enumerate(faults) if not follows(at)]


def _place(fault: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the place of a fault as the file has it."""
    return tuple(part for part in fault["loc"] if not _CHOICE.match(str(part)))


def _lines(fault: Mapping[str, Any], model: Any, table: str, shown: Callable[[Any], str] | None) -> Iterator[str]:
    place = _place(fault)
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
    if place and place[-1] == "[key]":
        pattern = fault.get("ctx", {}).get("pattern", "")
        yield f"{key.removesuffix('.[key]')}: is no name; it must match {pattern}" if pattern else f"{key}: {_said(fault)}"
        return
    said = _said(fault)
    value = fault.get("input")
    is_shown = "input" in fault and place and isinstance(value, str | int | float | bool | None)
    text = f" = {_short(shown(value))}" if is_shown and shown is not None else ""
    for line in said.split("\n"):
        yield f"{key}{text}: {line}" if place or table.endswith(".") else f"{table}{line}"


def _said(fault: Mapping[str, Any]) -> str:
    if (words := _WORDS.get(fault["type"])) is not None:
        return words(fault.get("ctx", {}))
    said = str(fault["msg"])
    for before, after in _SAID:
        said = said.replace(before, after)
    return said


def _too_short(context: Mapping[str, Any], what: str) -> str:
    least = context["min_length"]
    return f"needs {least} {what} or more" if least > 1 else "is empty; it needs an entry"


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
