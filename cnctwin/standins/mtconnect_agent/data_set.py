"""Data sets and tables: `key=value` pairs in one SHDR field, and how an update changes the set."""

import re
from collections.abc import Iterator, Mapping

from cnctwin.standins.mtconnect_agent.xml_text import escape

ENTRIES_MAX = 10_000

Cells = Mapping[str, str]
DataSet = Mapping[str, str | Cells | None]  # None: the entry is removed

_PAIR = re.compile(r"""([^\s=]+)(?:=(\{[^}]*\}|"(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'|[^\s]*))?""")


def parse_data_set(text: str, *, is_table: bool = False) -> DataSet:
    """Read `key=value` pairs; a key without `=` is an entry that is removed.

    >>> parse_data_set('a=1 b={two words} c')
    {'a': '1', 'b': 'two words', 'c': None}
    """
    return dict(_pairs(text, is_table))


def _pairs(text: str, is_table: bool) -> Iterator[tuple[str, str | Cells | None]]:
    for count, match in enumerate(_PAIR.finditer(text)):
        if count >= ENTRIES_MAX:
            return
        key, value = match[1], match[2]
        if value is None:
            yield key, None
        elif is_table and value.startswith("{"):
            yield key, {k: str(v) for k, v in _pairs(value[1:-1], False) if v is not None}
        else:
            yield key, value[1:-1] if value[:1] in ("{", '"', "'") else value


def changes(old: DataSet, new: DataSet) -> DataSet:
    """Return what of an update isn't in the set yet.

    >>> changes({"a": "1", "b": "2"}, {"a": "1", "b": None, "c": None})
    {'b': None}
    """
    return {key: value for key, value in new.items() if old.get(key) != value}


def merged(old: DataSet, new: DataSet) -> DataSet:
    """Return the set after an update.

    >>> merged({"a": "1", "b": "2"}, {"b": None, "c": "3"})
    {'a': '1', 'c': '3'}
    """
    return {key: value for key, value in {**old, **new}.items() if value is not None}


def entries_xml(entries: DataSet, indent: str) -> str:
    """Write the entries, one a line."""
    return "".join(f"\n{indent}{_entry_xml(key, value)}" for key, value in entries.items())


def _entry_xml(key: str, value: str | Cells | None) -> str:
    name = escape(key)
    if value is None:
        return f'<Entry key="{name}" removed="true"/>'
    if isinstance(value, str):
        return f'<Entry key="{name}">{escape(value)}</Entry>'
    cells = "".join(f'<Cell key="{escape(k)}">{escape(v)}</Cell>' for k, v in value.items())
    return f'<Entry key="{name}">{cells}</Entry>'
