"""Several files that are one recording: placed one after another in time, with what held at the end of one carried into the next.

Files with dates are placed by their dates, and what two of them have in common is taken from the earlier. Times that go on where
the file before ended are taken as they are. Times that begin again, without a date, say nothing of the gap: such a file is put
one row after the one before, and the account says so.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from cnctwin.errors import UsageError
from cnctwin.importing.rows import Block, Reading, blocks, empty
from cnctwin.importing.run_columns import STATES
from cnctwin.importing.stamps import NS
from cnctwin.importing.values import Values

OVERLAP = "rows that an earlier file has already"


class Part(NamedTuple):
    """One file of a recording, open, with its first rows already read."""

    name: str
    reading: Reading
    first: Block
    rest: Iterator[Block]


class Before(NamedTuple):
    """The file before: its name, begin and end, the usual step of its rows, and how far its times were moved."""

    name: str
    is_absolute: bool
    begin_ns: int
    end_ns: int
    step_ns: int
    shift_ns: int


def parts(readings: Sequence[tuple[str, Reading]], remarks: list[str]) -> list[Part]:
    """Begin to read each file, and put files with dates in order. Raises UsageError for one without a row."""
    found: list[Part] = []
    for name, reading in readings:
        rest = blocks(reading)
        first = next(rest, None)
        if first is None:
            why = "; ".join(f"{count} {what}" for what, count in reading.faults().items()) or "it is empty"
            raise UsageError(f"{name}: no row of it can be used: {why}")
        found.append(Part(name, reading, first, rest))
    if all(part.first.is_absolute for part in found):
        ordered = sorted(found, key=lambda part: int(part.first.t_ns[0]))
        if ordered != found:
            remarks.append(f"the files are taken in the order of their dates: {', '.join(part.name for part in ordered)}")
        return ordered
    return found


def joined(found: Sequence[Part], remarks: list[str]) -> Iterator[Block]:
    """Yield the rows of all files as those of one; what there is to say of the joints goes into `remarks`."""
    before: Before | None = None
    held: dict[str, Any] = {}
    for part in found:
        shift_ns = 0 if before is None else _shift(part, before, remarks)
        end_ns = None if before is None else before.end_ns
        step_ns = 1_000_000 if before is None else before.step_ns
        carries = before is not None
        for block in chain([part.first], part.rest):
            moved = _beyond(Block(block.t_ns + shift_ns, block.columns, block.is_absolute), end_ns, part.reading)
            if not len(moved.t_ns):
                continue
            moved = _carried(moved, held) if carries else moved
            carries = False
            for name in STATES & moved.columns.keys():
                held[name] = _last(moved.columns[name], held.get(name))
            if len(moved.t_ns) > 1:
                step_ns = int(np.median(np.diff(moved.t_ns)))
            end_ns = int(moved.t_ns[-1])
            yield moved
        assert end_ns is not None, "a part has rows"
        before = Before(part.name, part.first.is_absolute, int(part.first.t_ns[0]) + shift_ns, end_ns, step_ns, shift_ns)


def _beyond(block: Block, end_ns: int | None, reading: Reading) -> Block:
    """Return the rows after a time; those until then are an overlap, and counted."""
    if end_ns is None or block.t_ns[0] > end_ns:
        return block
    cut = int(np.searchsorted(block.t_ns, end_ns, side="right"))
    reading.count(OVERLAP, cut)
    return Block(block.t_ns[cut:], {name: values[cut:] for name, values in block.columns.items()}, block.is_absolute)


def _shift(part: Part, before: Before, remarks: list[str]) -> int:
    """Return how far the times of a file are moved, and say what is between it and the one before."""
    first_ns, is_absolute = int(part.first.t_ns[0]), part.first.is_absolute
    half_ns = before.begin_ns + (before.end_ns - before.begin_ns) // 2
    if is_absolute != before.is_absolute or (not is_absolute and first_ns + before.shift_ns <= half_ns):
        why = "has a date and the file before has none" if is_absolute else f"begins again at {first_ns / NS:g} s and has no date"
        step = f"one row ({before.step_ns / NS:g} s)"
        remarks.append(f"{part.name} {why}: it is put {step} after {before.name}; how long the gap was is not known")
        return before.end_ns + before.step_ns - first_ns
    gap_ns = first_ns + before.shift_ns - before.end_ns
    if gap_ns <= 0:
        seconds = f"{-gap_ns / NS:g} s"
        remarks.append(
            f"{part.name} begins {seconds} before the end of {before.name}; what both have is taken from {before.name}"
        )
    elif gap_ns > 3 * before.step_ns // 2:
        remarks.append(f"gap of {gap_ns / NS:g} s between {before.name} and {part.name}")
    return before.shift_ns


def _carried(block: Block, held: Mapping[str, Any]) -> Block:
    """Give the first row of a file what held at the end of the one before, where the file itself says nothing of it."""
    columns: dict[str, Values] = dict(block.columns)
    for name, value in held.items():
        if value is None or (name in columns and not _is_empty(columns[name][0])):
            continue
        columns[name] = columns[name].copy() if name in columns else empty(len(block.t_ns), is_text=isinstance(value, str))
        columns[name][0] = value
    return Block(block.t_ns, columns, block.is_absolute)


def _is_empty(value: object) -> bool:
    return value is None or value != value  # noqa: PLR0124  not a number


def _last(values: Values, before: object) -> object:
    return next((value for value in reversed(values.tolist()) if not _is_empty(value)), before)
