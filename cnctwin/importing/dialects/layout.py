"""The layout of a text table: separator, decimal mark, and the lines of names, of units and of the first values.

Files of oscilloscopes and dynamometers begin with any number of lines about the measurement. The values begin where a run of
lines has one number of fields, most of them numbers or times; above them stand the names, and between them perhaps the units.
"""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from cnctwin.importing.column_map import FileOptions
from cnctwin.importing.dialects.contract import HEAD_BYTES, Head, SourceColumn
from cnctwin.importing.units import unit_named

SEPARATORS = ("\t", ";", ",", "|", " ")
NULLS = ("", "nan", "null", "none", "n/a", "na", "-", "--", "---", "#n/a", "nil", "unavailable")
"""Texts that mean no value, in lower case."""
RUN = 3
_STAMP = re.compile(r"^(\d{4}-\d\d-\d\d|\d{1,2}[./]\d{1,2}[./]\d{2,4})([T ]+\d|$)|^\d{1,2}:\d\d:\d\d")
_NUMBER = {mark: re.compile(rf"^[+-]?(\d+{mark}?\d*|{mark}\d+)([eE][+-]?\d+)?$") for mark in (r"\.", ",")}
_BRACKETED = re.compile(r"^(?P<name>.*?)\s*[\[({](?P<unit>[^\])}]*)[\])}]\s*$")
_AFTER_SLASH = re.compile(r"^(?P<name>.*\S)\s+(?:in|/)\s+(?P<unit>\S+)$")


class Layout(NamedTuple):
    """A text table. data_line: index of the first line of values, from 0; columns: by position."""

    separator: str
    decimal: str
    data_line: int
    columns: tuple[SourceColumn, ...]


def is_number(text: str, decimal: str = ".") -> bool:
    """Return True where a text is a number with this decimal mark."""
    return bool(_NUMBER["," if decimal == "," else r"\."].match(text.strip()))


def fields(line: str, separator: str) -> list[str]:
    """Split a line; a run of spaces is one separator."""
    if separator == " ":
        return line.split()
    return [field.strip() for field in next(csv.reader([line], delimiter=separator), [])]


def head_lines(head: Head) -> list[str]:
    """Return the whole lines of a file's head."""
    lines = head.text.splitlines()
    return lines[:-1] if head.size > HEAD_BYTES and lines else lines


def layout(head: Head, options: FileOptions) -> Layout | None:
    """Return the layout of a text table; None where the file is none."""
    if "\x00" in head.text or head.text.lstrip().startswith("<"):
        return None
    lines = head_lines(head)
    separator = options.separator or _separator(lines)
    if separator is None:
        return None
    rows = [fields(line, separator) for line in lines]
    decimal = options.decimal or _decimal(rows, separator)
    data_line = _data_line(rows, decimal) if options.data_line is None else options.data_line - 1
    if options.header_lines is not None:
        data_line = options.header_lines
    if data_line is None or data_line >= len(rows):
        return None
    width = len(rows[data_line])
    names, units = _names_and_units(rows[:data_line], width, options)
    return Layout(separator, decimal, data_line, _columns(names, units, width))


def named(text: str) -> tuple[str, str]:
    """Split a heading into its name and its unit, "" where it states none.

    >>> named("X pos [mm]"), named("Fx (N)"), named("Torque"), named("speed in rpm"), named("force(1)")
    (('X pos', 'mm'), ('Fx', 'N'), ('Torque', ''), ('speed', 'rpm'), ('force(1)', ''))
    """
    match = _BRACKETED.match(text) or _AFTER_SLASH.match(text)
    if match and match["name"] and unit_named(match["unit"]) and not match["unit"].strip().isdigit():
        return match["name"], match["unit"]
    return text, ""


def _separator(lines: Sequence[str]) -> str | None:
    """Return the separator by which most of the last lines have one number of fields, most of them numbers."""
    best, found = 0.0, None
    sample = [line for line in lines if line.strip()][-50:]
    for separator in SEPARATORS:
        rows = [fields(line, separator) for line in sample]
        width, agreeing = Counter(len(row) for row in rows).most_common(1)[0] if rows else (0, 0)
        if width < 2:
            continue
        cells = [cell for row in rows if len(row) == width for cell in row]
        share = sum(_is_value(cell) for cell in cells) / len(cells)
        score = share * agreeing / len(rows)
        if score > best + 1e-9 and share > 0.3:
            best, found = score, separator
    if found is None and sample and all(_is_value(line) for line in sample[-3:]):
        return ";"  # one column
    return found


def _is_value(text: str) -> bool:
    return is_number(text) or is_number(text, ",") or text.lower() in NULLS or bool(_STAMP.match(text))


def _decimal(rows: Sequence[Sequence[str]], separator: str) -> str:
    """Return the comma where numbers have one and none has a point; a comma between fields is none."""
    cells = [cell for row in rows[-200:] for cell in row]
    commas = sum("," in cell and is_number(cell, ",") for cell in cells)
    points = sum("." in cell and is_number(cell) for cell in cells)
    return "," if commas > points and (separator != "," or commas) else "."


def _data_line(rows: Sequence[Sequence[str]], decimal: str) -> int | None:
    ready = [_is_data(row, decimal) for row in rows]
    for at in range(len(rows)):
        run = [index for index in range(at, len(rows)) if rows[index]][:RUN]
        if rows[at] and run and all(ready[index] and len(rows[index]) == len(rows[at]) for index in run):
            return at
    return None


def _is_data(row: Sequence[str], decimal: str) -> bool:
    told = [cell for cell in row if cell.lower() not in NULLS]
    known = [is_number(cell, decimal) or bool(_STAMP.match(cell)) for cell in told]
    return bool(told) and (known[0] or sum(known) * 2 > len(known))


def _names_and_units(above: Sequence[Sequence[str]], width: int, options: FileOptions) -> tuple[list[str], list[str]]:
    def line(number: int) -> list[str]:
        return list(above[number - 1]) if 1 <= number <= len(above) else []

    if options.names_line is not None:
        return line(options.names_line), line(options.units_line or 0)
    fitting = [row for row in above if row and width - 1 <= len(row) <= width + 1]
    if not fitting or fitting[-1] is not next((row for row in reversed(above) if row), None):
        return [], []
    last = list(fitting[-1])
    if options.units_line is not None:
        return list(fitting[-2]) if len(fitting) > 1 else [], line(options.units_line)
    if len(fitting) > 1 and _are_units(last):
        return list(fitting[-2]), last
    return last, []


def _are_units(row: Sequence[str]) -> bool:
    told = [cell for cell in row if cell and cell != "-"]
    return bool(told) and all(unit_named(cell) or re.fullmatch(r"[\[(].*[\])]", cell) for cell in told)


def _columns(names: Sequence[str], units: Sequence[str], width: int) -> tuple[SourceColumn, ...]:
    """Name the columns by position; one without a name, or with that of another, is called by its number."""
    found: list[SourceColumn] = []
    for at in range(width):
        text = names[at].strip() if at < len(names) else ""
        if not text or any(column.name == text for column in found):
            text = f"{text}#{at + 1}" if text else f"column_{at + 1}"
        unit = units[at].strip().strip("[](){}").strip() if at < len(units) else ""
        found.append(SourceColumn(text, unit if unit != "-" else "", "") if unit else SourceColumn(text, named(text)[1]))
    return tuple(found)
