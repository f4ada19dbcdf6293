"""Text export of TwinCAT Scope: a block of channel descriptions, then rows in which each group of channels has its own times.

The first line is `Name<tab>…`, then `File`, `Starttime of export` (100 ns since 1601); after empty lines the description, one
line for each property, and where a line says `Name` again a group of channels begins, with the column of its times at that place.
Times are in ms; groups have rates of their own, and a group that has ended leaves its fields empty. `ScaleFactor` and `Unit` are
applied already by the exporter. Tabs, semicolons or commas between fields, either decimal mark. After files that `pytcs`
(BSD) shows; it would bring pandas and polars, which are larger than all that cnctwin needs otherwise.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from cnctwin.errors import UsageError
from cnctwin.importing.column_map import FileOptions
from cnctwin.importing.dialects.contract import Content, Dialect, Faults, Head, Piece, SourceColumn, Times
from cnctwin.importing.dialects.delimited import text_rows
from cnctwin.importing.dialects.layout import Layout, fields, head_lines, is_number

_START = re.compile(r"(?mi)^\"?(?:Starttime of export|StartTime|Start time of export)\"?[\t;,]\"?(\d{17,19})")
_FILETIME_1970 = 116_444_736_000_000_000
_NO_UNIT = {"(none)", "none", ""}


def _separator(head: Head) -> str | None:
    first = next((line for line in head_lines(head) if line.strip()), "")
    match = re.match(r'"?(?:Name|ScopeName|File)"?([\t;,])', first)
    return match[1] if match else None


def _recognises(head: Head) -> bool:
    return (
        _separator(head) is not None
        and re.search(r"(?m)^\"?(SampleTime|Data-Type|SymbolName|SymbolComment)", head.text) is not None
    )


def _reads(path: Path, head: Head, options: FileOptions) -> Content:
    separator = options.separator or _separator(head) or "\t"
    rows = [fields(line, separator) for line in head_lines(head)]
    at = next((n for n in range(1, len(rows)) if rows[n][:1] == ["Name"]), None)
    data = None if at is None else next((n for n in range(at, len(rows)) if rows[n] and _is_first(rows[n])), None)
    if at is None or data is None:
        raise UsageError(f"{path}: has the head of a TwinCAT Scope export and no rows; export it again as CSV with its header")
    names = rows[at]
    units = next((row for row in rows[at:data] if row[:1] == ["Unit"]), [])
    comments = next((row for row in rows[at:data] if row[:1] == ["SymbolName"]), [])
    columns: list[SourceColumn] = []
    track = -1
    for place, name in enumerate(names):
        if name == "Name":
            track += 1
            columns.append(SourceColumn(f"time #{track + 1}", "ms", "", track))
            continue
        unit = units[place].partition("(")[0].strip() if place < len(units) else ""
        twice = any(column.name == name for column in columns)
        symbol = comments[place] if place < len(comments) else ""
        columns.append(
            SourceColumn(f"{name}#{place + 1}" if twice else name, "" if unit.lower() in _NO_UNIT else unit, symbol, track)
        )
    width = len(rows[data])
    columns += [SourceColumn(f"column_{n + 1}", "", "", max(track, 0)) for n in range(len(columns), width)]
    found = Layout(separator, options.decimal or _decimal(rows[at:]), data, tuple(columns[:width]))
    faults = Faults()

    def pieces() -> Iterator[Piece]:
        for block in text_rows(path, options.encoding or head.encoding, found, faults):
            for number in range(track + 1):
                yield Piece(number, {one.name: block[one.name] for one in found.columns if one.track == number})

    start = _START.search(head.text)
    start_ns = (int(start[1]) - _FILETIME_1970) * 100 if start else None
    tracks = tuple(Times(f"time #{number + 1}", "ms") for number in range(track + 1))
    return Content(found.columns, tracks, pieces, faults, found.decimal, start_ns)


def _is_first(row: list[str]) -> bool:
    return is_number(row[0]) or is_number(row[0], ",")


def _decimal(rows: list[list[str]]) -> str:
    """Return the decimal mark of the rows and of the sample times."""
    cells = [cell for row in rows for cell in row]
    commas = sum("," in cell and is_number(cell, ",") for cell in cells)
    return "," if commas > sum("." in cell and is_number(cell) for cell in cells) else "."


DIALECT = Dialect(name="TwinCAT Scope text", recognises=_recognises, reads=_reads)
