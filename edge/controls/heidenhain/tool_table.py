"""The control's tool table, TOOL.T: fixed columns under a line of names, with the tools' own data and their age.

    BEGIN TOOL.T MM
    T       NAME      L       R       DL      DR      TIME1 TIME2 CUR_TIME
    1       MILL_D12  +127.5  +6      -0.01   +0.005  60    50    18.5
    [END]

L and R are length and radius, DL and DR what they have worn, CUR_TIME the minutes that the tool has cut, and TIME1 those that it
may. A column is as wide as it is far to the next name. Tables of a machine that measures in inches say INCH.
"""

import re
from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import NamedTuple

from edge.reading import Outcome, Target, bad, read_value

ROWS_MAX = 10_000
INCH_MM = 25.4
_HEAD = re.compile(r"BEGIN .*?( MM| INCH)?( |$)")
_NAMES = re.compile(r"\S+")
_LENGTHS = ("L", "R", "DL", "DR")
_TIMES = ("TIME1", "CUR_TIME")
FEEDS = {
    "L": "tool_length_mm",
    "R": "tool_radius_mm",
    "DL": "tool_length_wear_mm",
    "DR": "tool_radius_wear_mm",
    "CUR_TIME": "tool_life_used_min",
    "TIME1": "tool_life_limit_min",
}
_OTHER_NAMES = {"CUR.TIME": "CUR_TIME", "TIME_1": "TIME1"}


class ToolRow(NamedTuple):
    """One tool: its number, and the figures of the columns in the order of `FEEDS`, None where a field is empty."""

    number: int
    figures: tuple[float | None, ...]


class ToolTable(NamedTuple):
    """The table as it was read; `fault`: why it cannot be used, "" where it can."""

    rows: tuple[ToolRow, ...] = ()
    columns: tuple[str, ...] = ()
    fault: str = ""

    def outcomes(self, tool: int) -> Iterator[tuple[str, Outcome]]:
        """Yield the signals of this tool, each with its value or a null with the reason."""
        row = next((row for row in self.rows if row.number == tool), None)
        for at, (column, name) in enumerate(FEEDS.items()):
            if self.fault or row is None:
                yield name, bad(self.fault or f"tool {tool} is not in the tool table")
            elif column not in self.columns:
                yield name, bad(f"the tool table has no column {column}")
            else:
                yield name, _outcome(name, column, row.figures[at], tool)


NOT_READ = ToolTable(fault="the tool table was not read yet")


def _outcome(name: str, column: str, figure: float | None, tool: int) -> Outcome:
    if figure is None or (column == "TIME1" and figure == 0):
        return bad(f"tool {tool} has no {column} in the tool table")
    known = Target(column, name).known
    return read_value(Target(column, name, low=known.low, high=known.high), figure)


def nulls(why: str) -> Iterator[tuple[str, Outcome]]:
    """Yield the signals of the table where no tool is known."""
    yield from ((name, bad(why)) for name in FEEDS.values())


@lru_cache(maxsize=8)
def read_table(text: str) -> ToolTable:
    """Read a table. One that is not whole has no rows, only a fault."""
    lines = text.splitlines()
    head = _HEAD.match(lines[0]) if lines else None
    if head is None:
        return ToolTable(fault="no table: it does not begin with BEGIN")
    names = next((at for at, line in enumerate(lines) if re.match(r"T\s", line) and {"L", "R"} <= set(line.split())), None)
    if names is None:
        return ToolTable(fault="the tool table has no line with the columns T, L and R")
    if not any(line.strip() == "[END]" for line in lines[names:]):
        return ToolTable(fault="the tool table has no [END]; it was not read whole")
    columns = {_OTHER_NAMES.get(found[0].upper(), found[0].upper()): found.start() for found in _NAMES.finditer(lines[names])}
    in_mm = INCH_MM if head[1] == " INCH" else 1.0
    rows = tuple(_rows(lines[names + 1 :], columns, in_mm))
    if len(rows) > ROWS_MAX:
        return ToolTable(fault=f"{len(rows)} tools are above the limit of {ROWS_MAX}")
    return ToolTable(rows, tuple(columns))


def _rows(lines: Iterable[str], columns: dict[str, int], in_mm: float) -> Iterator[ToolRow]:
    starts = sorted(columns.values())
    ends = {name: next((later for later in starts if later > start), None) for name, start in columns.items()}
    for line in lines:
        if line.strip() == "[END]":
            return
        number = line[: ends["T"]].strip()
        if number.isascii() and number.isdigit() and len(number) <= 9:  # 5.1 is an index of tool 5, and no tool of its own
            figures = (_figure(line[columns[name] : ends[name]]) if name in columns else None for name in FEEDS)
            scaled = (f if f is None or name in _TIMES else f * in_mm for name, f in zip(FEEDS, figures, strict=True))
            yield ToolRow(int(number), tuple(scaled))


def _figure(text: str) -> float | None:
    """A figure with a point, or the comma that some controls write; None for an empty field or what is no figure.

    >>> _figure("+127.5 "), _figure("-0,01"), _figure("   "), _figure("MILL")
    (127.5, -0.01, None, None)
    """
    word = text.strip().replace(",", ".")
    return float(word) if re.fullmatch(r"[+-]?\d{1,9}(\.\d{1,9})?", word) else None
