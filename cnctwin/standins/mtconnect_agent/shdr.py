r"""SHDR, what an MTConnect adapter sends: one line of text to time-stamped entries. No I/O.

`stamp|key|value|key|value…`, conditions as `stamp|key|level|native code|native severity|qualifier|text`, assets as
`stamp|@ASSET@|id|type|XML`, the XML also over several lines between two `--multiline--TAG` marks. Lines that begin
with `*` are commands between adapter and agent. A recorded `time|key|value` text file is the simplest case of it.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from cnctwin.standins.mtconnect_agent.stamp import Stamp, read_stamp

LINE_CHARS_MAX = 1_000_000
MULTILINE_MARK = "--multiline--"
CONDITION_LEVELS = frozenset({"NORMAL", "WARNING", "FAULT", "UNAVAILABLE"})
CONDITION_WIDTH = 5

_UNESCAPED_BAR = re.compile(r"(?<!\\)\|")


class Line(NamedTuple):
    """A line with a stamp: the fields after it, and the text as recorded (several lines for a long asset)."""

    stamp: Stamp
    fields: tuple[str, ...]
    text: str


class Command(NamedTuple):
    """A line between adapter and agent, such as `* PONG 10000`: no observation."""

    text: str


class Unusable(NamedTuple):
    """A line that can't be used, and the reason it is counted under."""

    reason: str
    text: str


class Entry(NamedTuple):
    """One key of a line with its values; no values where the line breaks off after the key."""

    key: str
    values: tuple[str, ...]


def parse_line(text: str) -> Line | Command | Unusable:
    """Take one line of text apart.

    >>> parse_line("2017-02-01T13:59:35.1Z|Block_Number|12").fields
    ('Block_Number', '12')
    >>> parse_line("20175")
    Unusable(reason='truncated', text='20175')
    """
    if text.startswith("*"):
        return Command(text)
    if len(text) > LINE_CHARS_MAX:
        return Unusable("line_too_long", text[:80])
    first, *fields = _split(text)
    if len(fields) < 2:
        return Unusable("truncated", text)
    stamp = read_stamp(first.strip())
    if stamp is None:
        return Unusable("bad_stamp", text)
    return Line(stamp, tuple(fields), text)


def parse_lines(texts: Iterable[str]) -> Iterator[Line | Command | Unusable]:
    """Take lines apart one after another, joining assets that span several."""
    source = iter(texts)
    for raw in source:
        text = raw.rstrip("\r\n")
        if not text.strip():
            continue
        parsed = parse_line(text)
        if isinstance(parsed, Line) and parsed.fields[-1].startswith(MULTILINE_MARK):
            yield _joined(parsed, source)
        else:
            yield parsed


def entries(fields: tuple[str, ...], width_of: Callable[[str], int]) -> Iterator[Entry]:
    """Yield each key with its values; `width_of(key)` is how many values follow it, 0 where the key is unknown.

    >>> list(entries(("a", "1", "b", ""), lambda key: 1))
    [Entry(key='a', values=('1',)), Entry(key='b', values=('',))]
    """
    position = 0
    while position < len(fields):
        key = fields[position].strip()
        width = width_of(key) or _unknown_width(fields, position)
        yield Entry(key, fields[position + 1 : position + 1 + width])
        position += 1 + width


def _unknown_width(fields: tuple[str, ...], position: int) -> int:
    """Skip an unknown condition whole, so that its empty fields aren't taken for further keys."""
    is_condition = position == 0 and len(fields) == 1 + CONDITION_WIDTH and fields[1].upper() in CONDITION_LEVELS
    return CONDITION_WIDTH if is_condition else 1


def _joined(head: Line, source: Iterator[str]) -> Line | Unusable:
    """Read on to the closing mark, which is the same text as the opening one."""
    mark = head.fields[-1]
    body: list[str] = []
    chars = 0
    for raw in source:
        text = raw.rstrip("\r\n")
        if text == mark:
            whole = "\n".join((head.text, *body, mark))
            return Line(head.stamp, (*head.fields[:-1], "\n".join(body)), whole)
        chars += len(text) + 1
        if chars > LINE_CHARS_MAX:
            return Unusable("line_too_long", head.text)
        body.append(text)
    return Unusable("truncated", head.text)


def _split(text: str) -> list[str]:
    r"""Split at bars; a bar inside a quoted value is written `\|`."""
    if "\\|" not in text:
        return text.split("|")
    fields = _UNESCAPED_BAR.split(text)
    return [f[1:-1].replace("\\|", "|") if _is_quoted(f) else f for f in fields]


def _is_quoted(field: str) -> bool:
    return len(field) >= 2 and field[0] == field[-1] == '"'
