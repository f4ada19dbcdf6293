"""The groups of lines that share one speed, and the speeds that suit all of them.

A group is what has to have one speed: a line with all its executions, and beside it every line that a stretch
(`twin.optimisation.speeds.stretches`) joins to one of these. A line of a subprogram is in the stretches of all its callers, and
joins them. A group may have the speeds that each of its lines may have by itself.

A line that is left alone runs at the speed that it was written for, so that its stretch keeps that speed. It does not join
stretches: it may be run at another speed in each.

One speed for a tool is one for its number, not for each time that it comes into the spindle: a jump, a skipped block or a call
may come from one of these times to the lines of another, and takes the speed with it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.optimisation.allowed import Allowed, Span
from twin.optimisation.answer import SpeedChanges
from twin.optimisation.program import Programmed
from twin.optimisation.speeds.stretches import Stretch, stretches
from twin.programs.source import source_lines

Ints = NDArray[np.int64]
Spans = tuple[Span, ...]
NOBODY = -1
HAIR = 1e-9
WAY_OUT = {
    SpeedChanges.ANYWHERE: "",
    SpeedChanges.IN_AIR: "--speed-changes anywhere",
    SpeedChanges.PER_TOOL: "--speed-changes in_air or anywhere",
}


class Kept(NamedTuple):
    """A line that is left alone (`line` in `Programmed.lines`) keeps its group at the speed that it was written for."""

    line: int
    rpm: float


@dataclass(frozen=True, slots=True, eq=False)
class SpeedGroups:
    """Groups in the order of their first lines. Rows are those of `Allowed`.

    rows: of each group; of_row: (lines,) its group, NOBODY in air; lead: (groups,) the longest line of each
    kept: of each group, None = its speed is free; own_spans: of each row by itself
    carriers: lines in air (`Programmed.lines`) that begin a stretch → the row whose speed they have
    inside: (parts, 3) first segment of a part of a stretch, first one outside of it, row whose speed it has
    """

    changes: SpeedChanges
    rows: tuple[Ints, ...]
    of_row: Ints
    lead: Ints
    kept: tuple[Kept | None, ...]
    own_spans: tuple[Spans, ...]
    carriers: Mapping[int, int]
    inside: Ints

    def __len__(self) -> int:
        return len(self.rows)

    def apart(self) -> "SpeedGroups":
        """Each line a group of its own, with the speeds that its group leaves it."""
        rows = np.sort(np.concatenate([np.empty(0, dtype=np.int64), *self.rows]))
        of_row = np.full(len(self.of_row), NOBODY, dtype=np.int64)
        of_row[rows] = np.arange(len(rows))
        return replace(self, rows=tuple(rows[:, None]), of_row=of_row, lead=rows, kept=(None,) * len(rows))

    def row_inside(self, segment: int) -> int:
        """The row whose speed is in force where a segment begins within a stretch; NOBODY outside of them."""
        mine = self.inside[(self.inside[:, 0] < segment) & (segment < self.inside[:, 1]), 2]
        return int(mine[0]) if len(mine) else NOBODY


def speed_groups(program: Programmed, allowed: Allowed, changes: SpeedChanges) -> tuple[Allowed, SpeedGroups, str]:
    """The lines with the speeds that their groups may have; the groups; and why a group has none, empty = each has some."""
    found = stretches(program, changes)
    row_of = {int(k): row for row, k in enumerate(allowed.index) if allowed.cutting[row]}
    carriers = _carriers(program, found, row_of) if changes is SpeedChanges.IN_AIR else frozenset()
    root = _joined(found, row_of.keys() | carriers)
    members: dict[int, list[int]] = {}
    for k, row in row_of.items():
        members.setdefault(root.get(k, k), []).append(row)
    members = {one: sorted(rows) for one, rows in sorted(members.items(), key=lambda item: min(item[1]))}
    alone = _left_alone(program, found, root)
    spans, kept, why = list(allowed.spans), [], ""
    for one, rows in members.items():
        mine = alone.get(one, {})
        common, fault = _common(program, allowed, rows, mine, changes)
        why = why or fault
        for row in rows:
            spans[row] = common or spans[row]
        kept.append(next(iter(mine.values()), None))
    of_row = np.full(len(allowed), NOBODY, dtype=np.int64)
    for group, rows in enumerate(members.values()):
        of_row[rows] = group
    length = [program.lines[int(k)].length_mm for k in allowed.index]
    lead = {one: max(rows, key=lambda row: length[row]) for one, rows in members.items()}
    of_line = {k: lead[one] for k, one in root.items() if one in lead}
    parts = [
        (*part, row)
        for stretch in found
        if (row := next((of_line[e.line] for e in stretch.executions if e.line in of_line), NOBODY)) != NOBODY
        for part in stretch.parts
    ]
    made = SpeedGroups(
        changes=changes,
        rows=tuple(np.array(rows, dtype=np.int64) for rows in members.values()),
        of_row=of_row,
        lead=np.array(list(lead.values()), dtype=np.int64),
        kept=tuple(kept),
        own_spans=allowed.spans,
        carriers={k: of_line[k] for k in carriers if k in of_line},
        inside=np.array(parts, dtype=np.int64).reshape(-1, 3),
    )
    return allowed.with_spans(spans), made, why


def _carriers(program: Programmed, found: tuple[Stretch, ...], row_of: Mapping[int, int]) -> frozenset[int]:
    """Lines in air that begin a stretch with lines of a speed of their own: they have that speed, which is changed before them.

    It is too late at the first cut: a feed down into a pocket ends in the material.
    """
    first = {stretch.executions[0].line for stretch in found if any(one.line in row_of for one in stretch.executions)}
    source = source_lines(program.text)
    plain = {k for k in first if (place := program.words.speed_place(source[program.lines[k].line])) is None or place.plain}
    return frozenset(k for k in plain if k not in row_of and not program.lines[k].needs_speed)


def _joined(found: tuple[Stretch, ...], which: "frozenset[int] | set[int]") -> dict[int, int]:
    """Line → the least line that stretches join it to, whatever lies between."""
    parent = {k: k for k in which}

    def root(k: int) -> int:
        while parent[k] != k:
            parent[k] = parent[parent[k]]
            k = parent[k]
        return k

    for stretch in found:
        mine = [one.line for one in stretch.executions if one.line in parent]
        for k in mine[1:]:
            a, b = root(mine[0]), root(k)
            parent[max(a, b)] = min(a, b)
    return {k: root(k) for k in parent}


def _left_alone(program: Programmed, found: tuple[Stretch, ...], root: Mapping[int, int]) -> dict[int, dict[float, Kept]]:
    """Return, by the root of each group, the speeds that lines left alone in its stretches need, with the first line of each."""
    programmed = np.abs(program.path.commanded_rpm())
    needed: dict[int, dict[float, Kept]] = {}
    for stretch in found:
        one = next((root[e.line] for e in stretch.executions if e.line in root), None)
        for begin, _, k in stretch.executions if one is not None else ():
            line, rpm = program.lines[k], float(programmed[begin])
            if one is not None and line.left_alone and line.needs_speed and rpm > 0.0:
                needed.setdefault(one, {}).setdefault(rpm, Kept(k, rpm))
    return needed


def _common(
    program: Programmed, allowed: Allowed, rows: list[int], kept: Mapping[float, Kept], changes: SpeedChanges
) -> tuple[Spans, str]:
    """The speeds that a group may have, none with the reason."""

    def number(row: int) -> int:
        return program.lines[int(allowed.index[row])].line + 1

    option, out = f"--speed-changes {changes}", WAY_OUT[changes]
    if len(kept) > 1:
        a, b = list(kept.values())[:2]
        lines, row = [program.lines[one.line].line + 1 for one in (a, b)], number(rows[0])
        why = f"lines {lines[0]} and {lines[1]} are left alone at {a.rpm:g} and {b.rpm:g} rev/min, and by {option} line {row}"
        return (), f"{why} has the speed of both; --leave {row}, or {out}"
    common = allowed.spans[rows[0]]
    for place, row in enumerate(rows[1:], 1):
        left = both(common, allowed.spans[row])
        if not left:
            other = next((o for o in rows[:place] if not both(allowed.spans[o], allowed.spans[row])), None)
            first = f"line {number(rows[0])} and those after it" if other is None else f"line {number(other)}"
            theirs = common if other is None else allowed.spans[other]
            why = f"{first} and line {number(row)} share one speed by {option}, and none suits all: "
            why += f"{shown(theirs)} and {shown(allowed.spans[row])} rev/min"
            return (), f"{why}; another limit, --leave {number(row)}, or {out}"
        common = left
    for one in kept.values():
        left = both(common, ((one.rpm, one.rpm),))
        if not left:
            row = next((o for o in rows if not both(allowed.spans[o], ((one.rpm, one.rpm),))), rows[0])
            why = (
                f"line {program.lines[one.line].line + 1} is left alone at {one.rpm:g} rev/min, and by {option} its speed is that"
            )
            why += f" of line {number(row)}, which may have {shown(allowed.spans[row])} rev/min"
            return (), f"{why}; another limit, --leave {number(row)}, or {out}"
        common = left
    return common, ""


def both(one: Spans, other: Spans) -> Spans:
    """The speeds that are in both, spans in order.

    >>> both(((1.0, 3.0), (5.0, 8.0)), ((2.0, 6.0), (8.0, 9.0)))
    ((2.0, 3.0), (5.0, 6.0), (8.0, 8.0))
    """
    found = [(max(a, c), min(b, d)) for a, b in one for c, d in other if max(a, c) <= min(b, d) * (1.0 + HAIR)]
    return tuple((min(low, high), high) for low, high in found)


def shown(spans: Spans) -> str:
    """
    >>> shown(((1000.0, 2400.4), (3000.0, 4000.0)))
    '1000 to 2400, 3000 to 4000'
    """
    return ", ".join(f"{a:.0f} to {b:.0f}" if b - a >= 1.0 else f"{a:.6g}" for a, b in spans)
