"""Files of a control's oscilloscope, of a dynamometer, or any table, as one run log.

Each file is recognised by what is in it, the map (or what is sure without one) says which columns are which, and the account says
what was taken, converted, left out and counted.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cnctwin.errors import UsageError
from cnctwin.files.output import check_suffix
from cnctwin.importing.column_map import ColumnMap, ColumnOptions, FileOptions
from cnctwin.importing.dialects.contract import Content, Dialect, SourceColumn
from cnctwin.importing.dialects.discovery import dialect_of, read_head
from cnctwin.importing.dialects.layout import named
from cnctwin.importing.joined import joined, parts
from cnctwin.importing.rows import Clock, Reading
from cnctwin.importing.run_columns import TORQUE, bounds_of, unit_of
from cnctwin.importing.run_writer import Written, write_blocks
from cnctwin.importing.suggestion import draft, suggestion
from cnctwin.importing.units import unit_named, units_for
from cnctwin.importing.values import Reader, Tally, reader
from twin.rotary import inside_column
from twin.runlog import AXIS_COLUMN


class MapNeededError(UsageError):
    """A recording whose columns are not sure without a map. draft: one for a person to check."""

    def __init__(self, message: str, draft: str) -> None:
        super().__init__(message)
        self.draft = draft


@dataclass(frozen=True, slots=True)
class Source:
    """The origin of a column of the run log."""

    name: str
    unit: str
    scale: float
    offset: float


@dataclass(frozen=True, slots=True)
class Account:
    """The account of an import: what it took and what it left out.

    files: name → dialect; rows: read of each file; columns: of the run log, by name; tallies: their values; left_out: columns of
    the files that are not taken; faults: file → what was left out and how often; remarks: one line each
    """

    files: Mapping[str, str]
    rows: Mapping[str, int]
    columns: Mapping[str, Source]
    tallies: Mapping[str, Tally]
    left_out: tuple[str, ...]
    faults: Mapping[str, Mapping[str, int]]
    remarks: tuple[str, ...]
    written: Written


def import_files(paths: Sequence[Path], chosen: ColumnMap | None, out: Path) -> Account:
    """Write the run log of these files. Raises MapNeededError where it needs a map and none is given, UsageError."""
    check_suffix(out)
    options = FileOptions() if chosen is None else chosen.options
    opened = [_opened(path, options) for path in paths]
    contents = [content for _, _, content in opened]
    units = {into: unit for _, dialect, _ in opened for into, unit in dialect.units.items()}
    remarks: list[str] = []
    if chosen is None:
        suggested = suggestion(contents, units)
        names, kinds = ", ".join(name for name, _, _ in opened), ", ".join(dict.fromkeys(one.name for _, one, _ in opened))
        if suggested.doubts or not suggested.map.columns:
            raise MapNeededError(_needed(names, suggested.doubts), draft(suggested, contents, names, kinds))
        chosen = suggested.map
        remarks.append(f"{kinds}: the names of the columns were sure, so no map was needed")
        assumed = [
            name for name, options in chosen.columns.items() if options.unit and not _states_unit(contents, options.source)
        ]
        if assumed:
            remarks.append(f"{kinds} states no unit of {', '.join(assumed)}: those of the control are taken; --map sets others")
    readings = [(name, _reading(name, content, dialect, chosen, remarks)) for name, dialect, content in opened]
    taken = _taken(readings, chosen, contents)
    _check_axes(taken)
    begun = parts(readings, remarks)
    written = write_blocks(joined(begun, remarks), list(taken), out)
    tallies = {name: _summed([reading.tallies[name] for _, reading in readings if name in reading.tallies]) for name in taken}
    return Account(
        files={name: dialect.name for name, dialect, _ in opened},
        rows={name: reading.rows for name, reading in readings},
        columns=taken,
        tallies=tallies,
        left_out=_left_out(contents, taken, readings),
        faults={name: faults for name, reading in readings if (faults := reading.faults())},
        remarks=(*remarks, *own_units(taken), *_constant(tallies)),
        written=written,
    )


def _states_unit(contents: Sequence[Content], name: str) -> bool:
    return any(column.name == name and column.unit for content in contents for column in content.columns)


def _needed(names: str, doubts: Sequence[str]) -> str:
    why = f"not everything about its columns is sure ({doubts[0]})" if doubts else "no column is known by its name"
    return f"{names}: {why}; save the map that is printed on standard output, check it, and give it with --map columns.toml"


def _opened(path: Path, options: FileOptions) -> tuple[str, Dialect, Content]:
    head = read_head(path, options.encoding)
    dialect = dialect_of(path, head)
    return path.name, dialect, dialect.reads(path, head, options)


def _reading(name: str, content: Content, dialect: Dialect, chosen: ColumnMap, remarks: list[str]) -> Reading:
    readers: dict[str, Reader] = {}
    for column, options in chosen.by_column().items():
        source = _source(content, options.source)
        if source is None:
            remarks.append(f"{name} has no column {options.source}, so no {column}")
            continue
        stated = source.unit if source.unit and unit_named(source.unit) else dialect.units.get(unit_of(column), "")
        found = reader(column, options.model_copy(update={"source": source.name}), stated, content.decimal, chosen.options.nulls)
        if found is None:
            there_are = units_for(unit_of(column))
            raise UsageError(
                f"{name}: {source.name} is in {stated}, which does not become {column}; name a unit ({there_are}) or a scale"
            )
        readers[column] = found
    return Reading(content, _clocks(name, content, chosen), readers)


def _source(content: Content, name: str) -> SourceColumn | None:
    """Return the column that the map names, by its whole heading or without the unit in it."""
    exact = [column for column in content.columns if column.name == name]
    bare = [column for column in content.columns if named(column.name)[0] == name]
    folded = [column for column in content.columns if column.name.strip().lower() == name.strip().lower()]
    return next(iter(exact or (bare if len(bare) == 1 else []) or (folded if len(folded) == 1 else [])), None)


def _clocks(name: str, content: Content, chosen: ColumnMap) -> list[Clock]:
    """Return where each track has its times: as the map says, else as the file does. Raises UsageError where neither does."""
    time = chosen.time
    clocks = []
    for track in content.tracks:
        column = track.column
        if time.column is not None and len(content.tracks) == 1:
            source = _source(content, time.column)
            if source is None:
                there_are = ", ".join(one.name for one in content.columns)
                raise UsageError(f"{name}: there is no column {time.column} for the times; there are {there_are}")
            column = source.name
        if time.period is not None and (time.column is None):
            clocks.append(Clock(None, period_s=time.period))
        elif column is not None:
            stated = next(one.unit for one in content.columns if one.name == column)
            known = stated if stated and unit_named(stated) in {"s", "ms", "µs", "ns", "min", "h"} else track.unit
            clocks.append(Clock(column, time.unit or known or "s", time.format))
        elif track.period_s is not None:
            clocks.append(Clock(None, period_s=track.period_s))
        else:
            there_are = ", ".join(one.name for one in content.columns)
            raise UsageError(f"{name}: say in [time] of the map which column is the time, or period_s; there are {there_are}")
    return clocks


def _taken(readings: Sequence[tuple[str, Reading]], chosen: ColumnMap, contents: Sequence[Content]) -> dict[str, Source]:
    taken: dict[str, Source] = {}
    for column, options in chosen.by_column().items():
        found = next((reading.readers[column] for _, reading in readings if column in reading.readers), None)
        if found is None:
            there_are = ", ".join(dict.fromkeys(one.name for content in contents for one in content.columns))
            raise UsageError(f"{column}: no file has its column {options.source}; there are {there_are}")
        taken[column] = _described(found, options, contents)
    if not taken:
        raise UsageError('the map names no column; add [columns.<name>] with from = "…"')
    return taken


def _described(found: Reader, options: ColumnOptions, contents: Sequence[Content]) -> Source:
    source = next(one for content in contents for one in content.columns if one.name == found.options.source)
    scale, offset = found.convert.scale * options.scale, found.convert.offset * options.scale + options.offset
    return Source(source.name, options.unit or source.unit, scale, offset)


def _check_axes(taken: Mapping[str, Source]) -> None:
    """Refuse an axis that goes straight and turns."""
    for name in taken:
        if inside_column(name) != name and inside_column(name) in taken:
            raise UsageError(f"{name} and {inside_column(name)} are both in the map; an axis turns or goes straight: keep one")


def _summed(tallies: Sequence[Tally]) -> Tally:
    total = Tally()
    for tally in tallies:
        total.values += tally.values
        total.low, total.high = min(total.low, tally.low), max(total.high, tally.high)
        total.example = total.example or tally.example
        for what, count in tally.faults.items():
            total.count(what, count)
    return total


def _left_out(
    contents: Sequence[Content], taken: Mapping[str, Source], readings: Sequence[tuple[str, Reading]]
) -> tuple[str, ...]:
    used = {source.name for source in taken.values()} | {clock.column for _, reading in readings for clock in reading.clocks}
    used |= {track.column for content in contents for track in content.tracks}
    return tuple(dict.fromkeys(one.name for content in contents for one in content.columns if one.name not in used))


def own_units(taken: Mapping[str, Source]) -> Iterator[str]:
    """Say which torques are not in amperes: the machine's description has to know."""
    for name, source in taken.items():
        match = AXIS_COLUMN.match(inside_column(name))
        unit = unit_named(source.unit)
        if match and unit_of(name) == TORQUE and unit not in {None, "A", "mA"}:
            yield f"{name} is in {unit}: give axes.{match[1]}.force_per_command_n (N for each {unit}) in machine.toml"


def _constant(tallies: Mapping[str, Tally]) -> Iterator[str]:
    for name, tally in tallies.items():
        if not tally.values:
            outside = f" within {bounds_of(name)}" if bounds_of(name) else ""
            yield f"{name} has no value{outside}"
