"""The schedule of a day, tick by tick: shifts, jobs, workpiece changes, waits and stops.

A tick is a row of the stacked cycles, in which row 0 is the machine at rest. A tool change takes a few ticks more or less, as
the magazine has a longer or a shorter way.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from cnctwin.standins.production.chance import DAY_S, HOUR_S, drawn
from cnctwin.standins.production.cycle import TICK_S, Cycle
from cnctwin.standins.production.variation import Variation

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
PLAN = 1
"""The number under which the schedule draws its chance."""


class Execution(IntEnum):
    """The state of the control; OFF = it is switched off and shows nothing."""

    OFF = 0
    READY = 1
    ACTIVE = 2
    FEED_HOLD = 3
    PROGRAM_COMPLETED = 4


@dataclass(frozen=True, slots=True)
class Shifts:
    """The hours in which the machine is switched on, UTC, and what interrupts them.

    days: of the week, from Monday on; breaks_h: when a break of break_min begins; stop_chance: that a part is held for a while
    wait_chance: that a workpiece change takes minutes; batch: parts of one program, least and most; setup_min: between batches
    """

    start_h: float = 6.0
    end_h: float = 22.0
    days: int = 5
    breaks_h: tuple[float, ...] = (10.0, 14.0, 18.0)
    break_min: float = 30.0
    change_s: tuple[float, float] = (9.0, 40.0)
    wait_chance: float = 0.05
    stop_chance: float = 0.01
    batch: tuple[int, int] = (20, 60)
    setup_min: tuple[float, float] = (10.0, 30.0)
    warms_up: bool = True

    def is_on(self, at_s: float) -> bool:
        """Return True if the machine is switched on at a time. 1970-01-01 was a Thursday.

        >>> Shifts().is_on(7 * 3600.0), Shifts().is_on(23 * 3600.0), Shifts().is_on(2 * 86400.0 + 7 * 3600.0)
        (True, False, False)
        """
        day, hour = at_s // DAY_S, at_s % DAY_S / HOUR_S
        return (day + 3) % 7 < self.days and self.start_h <= hour < self.end_h

    def until_s(self, at_s: float) -> float:
        """Return when the present shift or break between shifts ends."""
        midnight_s = at_s // DAY_S * DAY_S
        edges = (self.start_h, self.end_h, 24.0 + self.start_h)
        return next(midnight_s + hour * HOUR_S for hour in edges if midnight_s + hour * HOUR_S > at_s)

    def break_ends_s(self, at_s: float) -> float:
        """Return when the break ends that it is now, else `at_s`."""
        midnight_s = at_s // DAY_S * DAY_S
        for hour in self.breaks_h:
            begins_s = midnight_s + hour * HOUR_S
            if begins_s <= at_s < begins_s + 60.0 * self.break_min:
                return begins_s + 60.0 * self.break_min
        return at_s


USUAL_SHIFTS = Shifts()
ROUND_THE_CLOCK = Shifts(start_h=0.0, end_h=24.0, days=7, breaks_h=(), warms_up=False)


@dataclass(frozen=True, slots=True, eq=False)
class Ticks:
    """Arrays (n,): row of the stacked cycles, execution, number of the program, and the lot and wear of the part."""

    row: Ints
    execution: Ints
    program: Ints
    power_scale: Floats


class _Day:
    """A day as it is put together, stretch by stretch."""

    def __init__(self, shifts: Shifts, start_s: float, ticks: int) -> None:
        self.shifts, self.start_s, self.ticks, self.done = shifts, start_s, ticks, 0
        self.parts: list[tuple[Ints, Ints, int, float]] = []

    @property
    def now_s(self) -> float:
        return self.start_s + self.done * TICK_S

    @property
    def is_full(self) -> bool:
        return self.done >= self.ticks

    def add(self, rows: Ints, execution: Ints, program: int, scale: float = 1.0) -> None:
        self.parts.append((rows, execution, program, scale))
        self.done += len(rows)

    def rest(self, seconds: float, execution: Execution, program: int) -> None:
        """Stand still for so long, but not beyond the shift."""
        count = max(round(min(seconds, self.shifts.until_s(self.now_s) - self.now_s) / TICK_S), 1)
        self.add(np.zeros(count, dtype=np.int64), np.full(count, execution, dtype=np.int64), program)

    def all(self) -> Ticks:
        lengths = [len(rows) for rows, *_ in self.parts]
        row, execution = (np.concatenate([part[i] for part in self.parts])[: self.ticks] for i in (0, 1))
        program = np.repeat([part[2] for part in self.parts], lengths)[: self.ticks]
        scale = np.repeat([part[3] for part in self.parts], lengths)[: self.ticks]
        return Ticks(np.asarray(row), np.asarray(execution), np.asarray(program), np.asarray(scale))


def scheduled(cycles: Sequence[Cycle], shifts: Shifts, variation: Variation, seed: int, span_s: tuple[float, float]) -> Ticks:
    """Return the ticks of a span, s since 1970. The first of the cycles warms the spindle up, the others make parts in turn."""
    start_s, end_s = span_s
    day = _Day(shifts, start_s, round((end_s - start_s) / TICK_S))
    chance = drawn(seed, PLAN, int(start_s))
    starts = np.cumsum([1, *(len(cycle) for cycle in cycles)])
    program, part, left, lot = 1 + int(chance.integers(len(cycles) - 1)), int(chance.integers(10_000)), 0, 1.0
    warm = not shifts.is_on(start_s)
    while not day.is_full:
        if not shifts.is_on(day.now_s):
            day.rest(shifts.until_s(day.now_s) - day.now_s, Execution.OFF, program)
            warm = True
            continue
        if warm and shifts.warms_up:
            day.rest(float(chance.uniform(60.0, 600.0)), Execution.READY, 0)
            day.add(*_part(cycles[0], int(starts[0]), chance, variation, 0.0), 0)
            warm = False
        if (until_s := shifts.break_ends_s(day.now_s)) > day.now_s:
            day.rest(until_s - day.now_s, Execution.READY, program)
        if left == 0:
            left = int(chance.integers(*shifts.batch, endpoint=True))
            program = 1 + program % (len(cycles) - 1)
            lot = 1.0 + variation.material * float(chance.standard_normal())
            day.rest(60.0 * float(chance.uniform(*shifts.setup_min)) if day.done else 1.0, Execution.READY, program)
            continue
        wear = variation.wear * (part % variation.tool_life_parts) / variation.tool_life_parts
        day.add(*_part(cycles[program], int(starts[program]), chance, variation, shifts.stop_chance), program, lot * (1.0 + wear))
        day.rest(1.0, Execution.PROGRAM_COMPLETED, program)
        waits = chance.random() < shifts.wait_chance
        day.rest(float(chance.uniform(60.0, 600.0) if waits else chance.uniform(*shifts.change_s)), Execution.READY, program)
        left, part = left - 1, part + 1
    return day.all()


def _part(cycle: Cycle, start: int, chance: np.random.Generator, variation: Variation, stop_chance: float) -> tuple[Ints, Ints]:
    """The rows of one run of a cycle and its execution: tool changes vary, and now and then somebody holds the feed."""
    counts = np.ones(len(cycle), dtype=np.int64)
    ends = np.flatnonzero(np.diff(cycle.tool_change_active, append=0.0) < 0.0)
    longer = np.round(variation.change_s / TICK_S * chance.standard_normal(len(ends))).astype(np.int64)
    for end, ticks in zip(ends, longer, strict=True):
        inside = cycle.tool_change_active[max(end - 8, 0) : end + 1] > 0.0
        counts[end] += max(int(ticks), 0)
        if ticks < 0 and inside.all():
            counts[end + int(ticks) + 1 : end + 1] = 0
    held = np.zeros(len(cycle), dtype=np.int64)
    if chance.random() < stop_chance:
        at = int(chance.integers(len(cycle)))
        if not cycle.tool_change_active[at]:
            held[at] = round(float(chance.uniform(10.0, 600.0)) / TICK_S)
    rows = np.repeat(np.arange(start, start + len(cycle)), counts + held)
    execution = np.full(len(rows), int(Execution.ACTIVE), dtype=np.int64)
    if held.any():
        at = int(np.argmax(held))
        begin = int((counts + held)[:at].sum()) + 1
        execution[begin : begin + int(held[at])] = Execution.FEED_HOLD
    return rows, execution
