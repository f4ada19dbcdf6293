"""A map for a recording without one: used as it is where it is sure of everything, else drafted for a person to check."""

import json
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from cnctwin.importing.column_map import ISO_8601, ColumnMap, ColumnOptions, TimeOptions
from cnctwin.importing.dialects.contract import Content, SourceColumn
from cnctwin.importing.dialects.layout import is_number, named
from cnctwin.importing.naming import TIME, Guess, guess, words_of
from cnctwin.importing.stamps import iso_ns
from cnctwin.importing.units import conversion
from cnctwin.importing.values import Tally, read_numbers

COLUMNS_SHOWN = 60


class Suggestion(NamedTuple):
    """A guess at the content of a file. doubts: what a person has to check, one line each; empty where nothing is doubtful."""

    map: ColumnMap
    doubts: tuple[str, ...]
    unknown: tuple[SourceColumn, ...]


def suggestion(contents: Sequence[Content], units: Mapping[str, str]) -> Suggestion:
    """Return the map that these files, of one recording, suggest."""
    first = contents[0]
    time, doubts = _time(first)
    columns: dict[str, ColumnOptions] = {}
    unknown: list[SourceColumn] = []
    times = {time.column, *(track.column for track in first.tracks)}
    for source in {column.name: column for content in reversed(contents) for column in content.columns}.values():
        if source.name in times:
            continue
        found = guess(source, units)
        if found is None or found.column in columns:
            unknown.append(source)
            if found is not None:
                doubts.append(f"{source.name} may be {found.column} as well as {columns[found.column].source}")
            continue
        columns[found.column] = ColumnOptions.model_validate({"from": source.name, "unit": found.unit})
        doubts += _doubt(source, found)
    return Suggestion(ColumnMap(time=time, columns=columns), tuple(doubts), tuple(unknown))


def _doubt(source: SourceColumn, found: Guess) -> list[str]:
    if found.is_sure:
        return []
    if found.unit is None:
        return [f"{source.name} is taken for {found.column}; the file states no unit of it"]
    return [f"{source.name} is taken for {found.column}"]


def _time(content: Content) -> tuple[TimeOptions, list[str]]:
    track = content.tracks[0]
    if track.column is not None:
        return TimeOptions(), []
    if track.period_s is not None:
        return TimeOptions(period_s=track.period_s), []
    column = _time_column(content.columns)
    if column is None:
        return TimeOptions(period_s=0.001), ["no column is a time; period_s = 0.001 is assumed"]
    if column.unit == ISO_8601:
        return TimeOptions(column=column.name, format=ISO_8601), []
    if column.name == "t_s" or (column.unit and conversion(column.unit, "s")):
        return TimeOptions(column=column.name, unit=column.unit or "s"), []
    told = _first_values(content, column.name)
    texts = [str(value).strip() for value in told.to_pylist() if value is not None and str(value).strip()]
    if texts and all(iso_ns(text) is not None for text in texts[:20]):
        return TimeOptions(column=column.name, format=ISO_8601), []
    if texts and not all(is_number(text, content.decimal) for text in texts[:20]):
        form = "%d.%m.%Y %H:%M:%S.%f"
        return TimeOptions(column=column.name, format=form), [f"times such as {texts[0]!r} are taken to be in the format {form}"]
    steps = np.diff(read_numbers(told, content.decimal, (), Tally())[:1000])
    unit = "ms" if len(steps) and float(np.nanmedian(steps)) >= 0.1 else "s"
    return TimeOptions(column=column.name, unit=unit), [f"{column.name} states no unit; {unit} is guessed from its steps"]


def _time_column(columns: Sequence[SourceColumn]) -> SourceColumn | None:
    exact = [column for column in columns if column.name == "t_s" or column.unit == ISO_8601]
    by_name = [column for column in columns if {*words_of(named(column.name)[0])} & TIME]
    by_unit = [column for column in columns[:1] if column.unit and conversion(column.unit, "s")]
    return next(iter([*exact, *by_name, *by_unit]), None)


def _first_values(content: Content, name: str) -> pa.Array:
    """Return some values of a column; what the look meets is not counted, since the file is read again."""
    counted = dict(content.faults.counts)
    told = next((piece.values[name].slice(0, 2000) for piece in content.pieces()), pa.array([], type=pa.string()))
    content.faults.counts.clear()
    content.faults.counts.update(counted)
    return told


def draft(suggested: Suggestion, contents: Sequence[Content], names: str, dialect: str) -> str:
    """Return a columns.toml with the columns there are, for a person to check."""
    lines = [
        f"# A map of {names} ({dialect}) for `cnctwin import --map`. docs/how-to/recording.md explains it.",
        "# Columns of the file:",
    ]
    seen = {column.name: column for content in contents for column in content.columns}
    for column in [*seen.values()][:COLUMNS_SHOWN]:
        more = ", ".join(text for text in (column.unit, column.description) if text)
        lines.append(f"#   {column.name}{f'   ({more})' if more else ''}")
    if len(seen) > COLUMNS_SHOWN:
        lines.append(f"#   and {len(seen) - COLUMNS_SHOWN} more")
    lines += ["# To check:", *(f"#   {doubt}" for doubt in suggested.doubts)] if suggested.doubts else []
    time = suggested.map.time
    told = time.model_dump(exclude_none=True)
    if told:
        lines += ["", "[time]", *(f"{key} = {_toml(value)}" for key, value in told.items())]
    for column_name, options in suggested.map.columns.items():
        source = seen[options.source]
        lines += ["", f"[columns.{column_name}]", f"from = {_toml(options.source)}"]
        if options.unit is not None:
            remark = "" if source.unit else "   # not stated by the file: check"
            lines.append(f"unit = {_toml(options.unit)}{remark}")
        else:
            lines.append('# unit = ""   # not stated by the file: name it')
    if not suggested.map.columns:
        lines += [
            "",
            "# No column is known by its name. For each that you need:",
            "# [columns.x_pos_mm]",
            '# from = "…"',
            '# unit = "mm"',
        ]
    return "\n".join(lines) + "\n"


def _toml(value: object) -> str:
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
