"""One line about a fault in a configuration file: file, key, value, what is wrong, and the way out.

Several complaints of one table: a key that does not exist comes first, since one that is missing is often the same, misspelt.
"""

from collections.abc import Callable, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from edge.chosen import PlcSection, VariableSection
from sparkplug.shown_address import shown_address

_ENTRIES: dict[str, type[BaseModel]] = {"variables": VariableSection, "plc": PlcSection}
_EXAMPLE = 'write it as {} = {{ address = "…", unit = "…" }}; docs/edges.md says how an address is written'
_Words = Callable[[Mapping[str, Any]], str]
_WORDS: dict[str, _Words] = {
    "string_type": lambda _: "is no text; put it in quotes",
    "string_too_short": lambda _: "is empty; write what it should be",
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
    "literal_error": lambda c: f"is none of the possible words; it may be {c['expected']}",
    "enum": lambda c: f"is none of the possible words; it may be {c['expected']}",
    "dict_type": lambda _: "is no table",
    "model_type": lambda _: "is no table",
    "too_long": lambda c: f"has {c['actual_length']} entries; the limit is {c['max_length']}",
}


def one_line(path: Path, table: str, error: ValidationError) -> str:
    """Return the complaint of pydantic that says most, as a person writes it."""
    complaints = error.errors(include_url=False)
    first = next((one for one in complaints if one["type"] == "extra_forbidden"), complaints[0])
    entry = str(first["loc"][0]) if table in _ENTRIES and first["loc"] else ""
    key = ".".join(str(part) for part in (*filter(None, [table]), *first["loc"]) if part != "[key]")
    if first["type"] == "extra_forbidden":
        return f"{path}: {key}: no such key; {_right_name(table, str(first['loc'][-1]))}"
    if first["type"] == "missing":
        return f"{path}: {key}: is missing" + (f"; {_EXAMPLE.format(entry)}" if entry else "; add it")
    if first["loc"] and first["loc"][-1] == "[key]":
        return f"{path}: {key}: is no name; it may have up to 32 lower-case letters, digits and underscores, the first a letter"
    return f"{path}: {key}{_shown(first['input'])}: {_wrong(first)}" + _table_wanted(first["type"], key, entry)


def _shown(value: object) -> str:
    """Return the value behind its equals sign; nothing where it is a whole table, which is read in the file."""
    if isinstance(value, dict | list):
        return ""
    is_address = any(mark in str(value) for mark in ("//", "?", "@"))  # of a broker or control; "#500" is a variable's
    return f" = {shown_address(repr(value)) if is_address else repr(value)}"


def _wrong(complaint: Any) -> str:
    words = _WORDS.get(complaint["type"])
    return words(complaint.get("ctx", {})) if words else str(complaint["msg"]).removeprefix("Value error, ")


def _table_wanted(kind: str, table: str, entry: str) -> str:
    if kind not in ("dict_type", "model_type"):
        return ""
    return f"; {_EXAMPLE.format(entry)}" if entry else f"; write it as [{table}], with its keys below"


def _right_name(table: str, given: str) -> str:
    if table not in _ENTRIES:
        return "remove it, or see the sample configuration beside the adapter for the right name"
    known = list(_ENTRIES[table].model_fields)
    near = get_close_matches(given, known, 1)
    return f"is it {near[0]}? " * bool(near) + f"there are {', '.join(known)}"
