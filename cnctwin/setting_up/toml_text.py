"""Edits of a TOML file that a person keeps: one key becomes another, comments and everything else stay as they are."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from cnctwin.errors import UsageError

_HEADER = re.compile(r"^\s*\[")
_COMMENT = re.compile(r"""^(?P<value>"(?:[^"\\]|\\.)*"|'[^']*'|[^#"']*?)(?P<comment>\s*#.*)?$""")


def with_key(text: str, table: str, key: str, value: str | int | float | bool, path: Path) -> str:
    """Return a file's text with `key` of `[table]` set, the table added where it is missing. Raises UsageError where the file
    is written in a way that this cannot edit.

    >>> text = '[broker]  # ours\\nurl = "mqtt://a"  # the old one\\n'
    >>> print(with_key(text, "broker", "url", "mqtt://b", Path("edge.toml")), end="")
    [broker]  # ours
    url = "mqtt://b"  # the old one
    """
    wanted = _set(_read(text, path), table, key, value)
    lines = text.splitlines()
    begin = _line_of(lines, table)
    written = f"{key} = {json.dumps(value, ensure_ascii=False)}"
    if begin is None:
        lines += [*([""] if lines and lines[-1] else []), f"[{table}]", written]
    else:
        end = _end_of(lines, begin)
        at = next((i for i in range(begin + 1, end) if re.match(rf"\s*{re.escape(key)}\s*=", lines[i])), None)
        if at is None:
            last = max(i for i in range(begin, end) if lines[i].strip())
            lines.insert(last + 1, written)
        else:
            found = _COMMENT.match(lines[at].partition("=")[2].strip())
            lines[at] = written + ((found["comment"] or "") if found else "")
    return _checked("\n".join(lines) + "\n", wanted, f"{key} of [{table}]", path)


def without_table(text: str, table: str, path: Path) -> str:
    """Return a file's text without `[table]`; the same where there is none. Raises UsageError.

    >>> without_table('[a]\\nx = 1\\n\\n[b.c]\\ny = 2\\n', "b.c", Path("a.toml"))
    '[a]\\nx = 1\\n'
    """
    lines = text.splitlines()
    begin = _line_of(lines, table)
    if begin is None:
        return text
    wanted = _read(text, path)
    *above, last = table.split(".")
    inside = wanted
    for name in above:
        inside = inside[name]
    del inside[last]
    kept = "\n".join(lines[:begin]).rstrip("\n") + "\n"
    rest = "\n".join(lines[_end_of(lines, begin) :])
    found = _checked(kept + (f"\n{rest}\n" if rest else ""), None, f"[{table}]", path)
    if _emptied(_read(found, path)) != _emptied(wanted):
        raise UsageError(f"{path}: [{table}] cannot be removed without changing more; remove it by hand")
    return found


def _read(text: str, path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path}: is not TOML: {error}; mend it first") from None


def _set(tables: dict[str, Any], table: str, key: str, value: Any) -> dict[str, Any]:
    inside = tables
    for name in table.split("."):
        inside = inside.setdefault(name, {})
    inside[key] = value
    return tables


def _line_of(lines: list[str], table: str) -> int | None:
    """Return the line of a table's header; None where there is none."""
    header = re.compile(rf"^\s*\[\s*{re.escape(table)}\s*\]\s*(#.*)?$")
    return next((i for i, line in enumerate(lines) if header.match(line)), None)


def _end_of(lines: list[str], begin: int) -> int:
    """Return the line behind a table; comments that stand right above the next header are of that one."""
    end = next((i for i in range(begin + 1, len(lines)) if _HEADER.match(lines[i])), len(lines))
    while end < len(lines) and end > begin + 1 and lines[end - 1].lstrip().startswith("#"):
        end -= 1
    return end


def _emptied(tables: dict[str, Any]) -> dict[str, Any]:
    """Return tables without those that hold nothing."""
    inner = {name: _emptied(value) if isinstance(value, dict) else value for name, value in tables.items()}
    return {name: value for name, value in inner.items() if value != {}}


def _checked(text: str, wanted: dict[str, Any] | None, what: str, path: Path) -> str:
    """Return the text where it says what is wanted, so that no edit ever changes anything else."""
    try:
        says = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        says = None
    if says is None or (wanted is not None and says != wanted):
        raise UsageError(f"{path}: {what} cannot be set without changing more; set it by hand")
    return text
