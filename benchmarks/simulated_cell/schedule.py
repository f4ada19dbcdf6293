"""The schedule of a machine: shifts, batches of parts, operations line by line, tool changes and stops.

Two shifts from 6 to 22 o'clock on six days; a warm-up each morning; batches of 10 to 60 parts of one of three programs, and of a
new one from the second of the judged days on; tools that wear over 40 parts and are replaced; material that differs from batch to
batch; an operator who sets the feed override for an operation, turns it by hand for some minutes, and proves the first part of a
batch at half feed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulated_cell.fault import LIFE_PARTS
from benchmarks.simulated_cell.machine import ACCELERATION_MM_S2, RAPID_MM_MIN, Machine
from benchmarks.simulated_cell.part_program import BESIDE_MM, Line, Operation, Work

Floats = NDArray[np.float64]
DAY_S = 86400
SHIFTS_S = (6 * 3600, 22 * 3600)
WORK_DAYS = 6
KNOWN_PROGRAMS = 3
WARM_UP_NAME, WARM_UP_S = "O9000", 300.0
WARM_UP = tuple(
    Operation("warm_up", place + 1, rpm, False, 1 + place, (), (Line(1 + place, 0.0, 8000.0, -1),))
    for place, rpm in enumerate((1000.0, 4000.0, 8000.0))
)
HALT_S = 0.08
"""A line takes so long beyond its length over its feed: it starts and stops."""
HAND_SHARE = 0.002
"""Operations in which somebody turns the override by hand."""


class Part(NamedTuple):
    """A part: its program's place, how many of the program came before it, when, and whether it is a batch's first."""

    program: int
    number: int
    start_s: float
    end_s: float
    is_first: bool


class Rows(NamedTuple):
    """All lines of a machine's programs, one after another (L,). cut: row of the passes, 0 = in air."""

    number: NDArray[np.int32]
    length_mm: Floats
    feed_mm_min: Floats
    cut: NDArray[np.int32]
    lead_mm: Floats
    stock_mm: Floats
    reach_mm: Floats
    depth_mm: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Schedule:
    """One row a second, (T,): `stretch` is the place in the columns of stretches, which are one row a stretch.

    operations: of the warm-up and of all programs; program_of: place in `names` of each; lines: their lines
    work, operation, line: the kind of Work, place in `operations`, row of `lines`; −1 = none
    since_s: time since the stretch began; lasts_s, override, material, wear, chatter: of each stretch
    program, tool_number, nc_line, feed_override_pct: as the control tells them; program 0 is the warm-up
    tool_change_active: as the control tells it
    is_changing: a tool change is really going on, from the stop of the spindle to its being back at speed
    hands_s: when somebody turned the override by hand
    """

    operations: tuple[Operation, ...]
    program_of: NDArray[np.int64]
    lines: Rows
    names: tuple[str, ...]
    stretch: NDArray[np.int32]
    since_s: NDArray[np.float32]
    work: NDArray[np.int8]
    operation: NDArray[np.int16]
    line: NDArray[np.int32]
    lasts_s: Floats
    override: Floats
    material: Floats
    wear: Floats
    chatter: Floats
    program: NDArray[np.int16]
    tool_number: NDArray[np.int16]
    nc_line: NDArray[np.int32]
    feed_override_pct: Floats
    tool_change_active: NDArray[np.bool_]
    is_changing: NDArray[np.bool_]
    parts: tuple[Part, ...]
    hands_s: tuple[tuple[float, float], ...]


@dataclass
class _Stretches:
    """Stretches of work one after another."""

    columns: list[Floats] = field(default_factory=list)
    now_s: float = 0.0
    parts: list[Part] = field(default_factory=list)
    hands_s: list[tuple[float, float]] = field(default_factory=list)

    def add(self, work: Work, operation: int, duration_s: float, line: int = -1, override: float = 1.0) -> None:
        self.many(np.array([[work, operation, line, max(0.05, duration_s), override, 1.0, 0.0, 1.0]]).T)

    def many(self, rows: Floats) -> None:
        """rows: (8, n) of work, operation, line, duration, override, material, wear, chatter."""
        self.columns.append(rows)
        self.now_s += float(rows[3].sum())


@dataclass
class _Shop:
    """The state of a machine's work as it is drawn."""

    machine: Machine
    rng: np.random.Generator
    first_operation: list[int]
    first_line: list[int]
    worn: dict[int, int]
    made: list[int]
    hand: tuple[float, float] = (0.0, 1.0)


def rows_of(machine: Machine, operations: Sequence[Operation]) -> tuple[Rows, list[int]]:
    """Return the lines of operations, one after another, and the place of each operation's first."""
    found, first, cuts = [], [], 1
    for one in operations:
        first.append(len(found))
        diameter = machine.tools[one.tool].diameter_mm if one.cuts else 0.0
        for line in one.lines:
            cut = one.cuts[line.cut] if line.cut >= 0 else None
            reach, depth = (cut.reach_mm(diameter), cut.depth_mm) if cut else (1.0, 1.0)
            row = cuts + line.cut if cut else 0
            found.append(
                (line.number, line.length_mm, line.feed_mm_min, row, 0.5 * diameter + BESIDE_MM, one.stock_mm, reach, depth)
            )
        cuts += len(one.cuts)
    columns = [np.array(column, dtype=np.float64) for column in zip(*found, strict=True)]
    return Rows(columns[0].astype(np.int32), columns[1], columns[2], columns[3].astype(np.int32), *columns[4:]), first


def has_whole_arc(own: Schedule) -> NDArray[np.bool_]:
    """Return the seconds in which a pass cuts with the whole of its arc: neither entering nor leaving the stock."""
    lines, line = own.lines, own.line
    gone = lines.length_mm[line] * own.since_s / own.lasts_s[own.stretch]
    lead, leaves = lines.lead_mm[line], lines.lead_mm[line] + lines.stock_mm[line] - lines.reach_mm[line]
    return np.asarray((own.work == Work.CUTTING) & (gone > lead) & (gone < leaves))


def draw_schedule(machine: Machine, days: int, rng: np.random.Generator, new_from_day: int | None = None) -> Schedule:
    """The work of the machine in `days` days, from Monday 0 o'clock on; the last program is new on `new_from_day`."""
    operations = (*WARM_UP, *(operation for program in machine.programs for operation in program.operations))
    starts = np.cumsum([len(WARM_UP), *(len(program.operations) for program in machine.programs)]).tolist()
    lines, first_line = rows_of(machine, operations)
    tools = sorted({operation.tool for operation in operations})
    worn = {tool: int(rng.integers(0, LIFE_PARTS)) for tool in tools}
    shop = _Shop(machine, rng, starts, [*first_line, len(lines.number)], worn, [0] * len(machine.programs))
    stretches, batch, program, material = _Stretches(), 0, 0, 1.0
    for day in range(days):
        if day % 7 >= WORK_DAYS:
            continue
        stretches.add(Work.STANDING, -1, day * DAY_S + SHIFTS_S[0] + rng.uniform(0, 900) - stretches.now_s)
        for step in range(len(WARM_UP)):
            stretches.add(Work.WARM_UP, step, WARM_UP_S, line=step)
        while stretches.now_s < day * DAY_S + SHIFTS_S[1]:
            is_first = batch == 0
            if is_first:
                is_new = new_from_day is not None and day >= new_from_day
                batch, program = int(rng.integers(10, 61)), int(rng.integers(KNOWN_PROGRAMS + is_new))
                if is_new and not shop.made[KNOWN_PROGRAMS]:
                    program = KNOWN_PROGRAMS
                material = float(np.exp(rng.normal(0.0, 0.05)))
                stretches.add(Work.STANDING, -1, rng.uniform(300, 1500))
            _part(stretches, shop, operations, lines, program, material=material, is_first=is_first)
            batch -= 1
            if rng.random() < 0.02:
                stretches.add(Work.STANDING, -1, rng.uniform(600, 2400))
    stretches.add(Work.STANDING, -1, max(1.0, days * DAY_S - stretches.now_s))
    return _ticks(stretches, operations, lines, shop, days * DAY_S)


def _part(
    stretches: _Stretches,
    shop: _Shop,
    operations: Sequence[Operation],
    lines: Rows,
    program: int,
    *,
    material: float,
    is_first: bool,
) -> None:
    rng, machine = shop.rng, shop.machine
    started_s = stretches.now_s
    stretches.add(Work.LOADING, -1, rng.uniform(20, 60))
    first = shop.first_operation[program]
    for place in range(first, first + len(machine.programs[program].operations)):
        change_s = 3 + machine.label_late_s * rng.uniform(0.8, 1.2) + rng.uniform(5, 9)
        stretches.add(Work.TOOL_CHANGE, place, change_s)
        override = 0.5 if is_first else float(rng.choice([1.0, 0.9, 0.8, 1.1], p=[0.94, 0.02, 0.02, 0.02]))
        chatter = float(rng.uniform(1.2, 1.6)) if rng.random() < 0.02 else 1.0
        is_hand, hand, lasts_s = rng.random() < HAND_SHARE, float(rng.uniform(0.6, 1.2)), float(rng.uniform(120, 600))
        stretches.add(Work.RAPID, place, rng.uniform(3, 8))
        if rng.random() < (0.3 if is_first else 0.03):
            stretches.add(Work.STOP, place, rng.uniform(5, 30))
        if is_hand:
            begins_s = stretches.now_s + float(rng.uniform(0.0, 30.0))
            shop.hand = (begins_s + lasts_s, round(hand, 1))
            stretches.hands_s.append((begins_s, begins_s + lasts_s))
        wear = shop.worn[operations[place].tool] / LIFE_PARTS
        span = slice(shop.first_line[place], shop.first_line[place + 1])
        stretches.many(_cut(stretches, shop, lines, span, place, drawn=(override, material, wear, chatter)))
    for tool in {operations[place].tool for place in range(first, first + len(machine.programs[program].operations))}:
        shop.worn[tool] = (shop.worn[tool] + 1) % LIFE_PARTS
    stretches.parts.append(Part(program, shop.made[program], started_s, stretches.now_s, is_first))
    shop.made[program] += 1


def _cut(
    stretches: _Stretches, shop: _Shop, lines: Rows, span: slice, place: int, *, drawn: tuple[float, float, float, float]
) -> Floats:
    """The lines of an operation as stretches: (8, n)."""
    override, material, wear, chatter = drawn
    length, feed = lines.length_mm[span], lines.feed_mm_min[span]
    is_rapid = feed <= 0.0
    rapid_s = np.maximum(60.0 * length / RAPID_MM_MIN, 2.0 * np.sqrt(length / ACCELERATION_MM_S2)) + HALT_S
    cut_s = 60.0 * length / np.maximum(feed, 1.0)
    overrides = np.full(len(length), override)
    lasts = np.where(is_rapid, rapid_s, cut_s / override + HALT_S)
    if shop.hand[0] > stretches.now_s:
        begins_s = stretches.hands_s[-1][0]
        at_s = stretches.now_s
        for row in range(len(length)):
            if begins_s <= at_s < shop.hand[0]:
                overrides[row] = shop.hand[1]
                lasts[row] = rapid_s[row] if is_rapid[row] else cut_s[row] / shop.hand[1] + HALT_S
            at_s += float(lasts[row])
    rows = np.empty((8, len(length)))
    rows[0] = np.where(lines.cut[span] > 0, Work.CUTTING, Work.RAPID)
    rows[1], rows[2] = place, np.arange(span.start, span.stop)
    rows[3], rows[4], rows[5], rows[6], rows[7] = lasts, overrides, material, wear, chatter
    return rows


def _ticks(stretches: _Stretches, operations: tuple[Operation, ...], lines: Rows, shop: _Shop, ticks: int) -> Schedule:
    work, operation, line, lasts, override, material, wear, chatter = np.concatenate(stretches.columns, axis=1)
    machine, rng = shop.machine, shop.rng
    starts = np.cumsum(lasts) - lasts
    t_s = np.arange(ticks, dtype=np.float64)
    each = np.searchsorted(starts, t_s, side="right") - 1
    since = t_s - starts[each]
    is_changing = work[each] == Work.TOOL_CHANGE
    late = machine.label_late_s * rng.uniform(0.8, 1.2, len(lasts))[each]
    told = is_changing & (since >= np.round(late) + 2) & (since < np.round(late) + 3) if machine.label_late_s else is_changing
    running = np.maximum(operation[np.maximum.accumulate(np.where(operation >= 0, np.arange(len(operation)), 0))], 0).astype(int)
    counts = [len(WARM_UP), *(len(program.operations) for program in machine.programs)]
    program = np.repeat(np.arange(len(counts)), counts)
    tool = np.array([one.tool for one in operations])
    last = np.maximum.accumulate(np.where(line >= 0, np.arange(len(line)), 0))
    number = lines.number[np.maximum(line[last], 0).astype(int)]
    changed_at = np.array([one.first for one in operations])[np.maximum(operation, 0).astype(int)]
    number = np.where((line < 0) & (operation >= 0) & (work != Work.STOP), changed_at, number)
    at_work = np.where(operation >= 0, override, 1.0)
    return Schedule(
        operations=operations,
        program_of=program,
        lines=lines,
        names=(WARM_UP_NAME, *(one.name for one in machine.programs)),
        stretch=each.astype(np.int32),
        since_s=since.astype(np.float32),
        work=work[each].astype(np.int8),
        operation=operation[each].astype(np.int16),
        line=line[each].astype(np.int32),
        lasts_s=lasts,
        override=override,
        material=material,
        wear=wear,
        chatter=chatter,
        program=program[running][each].astype(np.int16),
        tool_number=tool[running][each].astype(np.int16),
        nc_line=number[each].astype(np.int32),
        feed_override_pct=np.round(100.0 * _held(at_work, line)[each]),
        tool_change_active=told,
        is_changing=is_changing,
        parts=tuple(stretches.parts),
        hands_s=tuple(stretches.hands_s),
    )


def _held(override: Floats, line: Floats) -> Floats:
    """The override of the line that runs; before the first line of an operation, that of this line."""
    place = np.where(line >= 0, np.arange(len(line)), len(line) - 1)
    ahead = np.minimum.accumulate(place[::-1])[::-1]
    return np.asarray(override[ahead], dtype=np.float64)
