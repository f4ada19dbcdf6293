"""When a machine does what: shifts, batches of parts, operations, tool changes and stops, one row a second.

Two shifts from 6 to 22 o'clock on six days; a warm-up each morning; batches of 10 to 60 parts of one of three programs; tools
that wear and are replaced; material that differs from batch to batch; an operator who turns the feed override, and who proves the
first part of a batch at half feed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulated_cell.part_program import Operation, Work, draw_program

Floats = NDArray[np.float64]
DAY_S = 86400
SHIFTS_S = (6 * 3600, 22 * 3600)
WORK_DAYS = 6
WARM_UP = (
    Operation(300.0, 1000, 3, 8000, 0.03, 9),
    Operation(300.0, 4000, 4, 8000, 0.06, 9),
    Operation(300.0, 8000, 6, 8000, 0.10, 9),
)
PROGRAMS = 3


@dataclass(frozen=True, slots=True)
class Machine:
    """What is peculiar to one machine.

    label_late_s: how long after the spindle's stop its control tells of a tool change; 0: when it begins, as with M06
    """

    programs: tuple[tuple[Operation, ...], ...]
    label_late_s: float
    ambient_offset_k: float


@dataclass(frozen=True, slots=True)
class Schedule:
    """One row a second. (T,) each.

    work: the kind of Work; operation: place in `operations`, −1 = none; since_s: time since the stretch began
    load_scale, feed_scale, vibration_scale: wear, material and override of this stretch
    program, tool_number, feed_override_pct: as the control tells them; program 0 is the warm-up
    tool_change_active: as the control tells it
    is_changing: a tool change is really going on, from the stop of the spindle to its being back at speed
    """

    operations: tuple[Operation, ...]
    work: NDArray[np.int8]
    operation: NDArray[np.int16]
    since_s: NDArray[np.int32]
    load_scale: Floats
    feed_scale: Floats
    vibration_scale: Floats
    program: NDArray[np.int16]
    tool_number: NDArray[np.int16]
    feed_override_pct: Floats
    tool_change_active: NDArray[np.bool_]
    is_changing: NDArray[np.bool_]


def draw_machine(rng: np.random.Generator, is_late: bool) -> Machine:
    """A machine with its programs."""
    programs = tuple(draw_program(rng) for _ in range(PROGRAMS))
    return Machine(programs, float(rng.uniform(5.0, 13.0)) if is_late else 0.0, float(rng.normal(0.0, 1.0)))


class _Stretches:
    """Stretches of work one after another, up to an end."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, int, int, float, float, float]] = []
        self.now_s = 0

    def add(self, work: Work, operation: int, duration_s: float, scales: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> None:
        ticks = max(1, round(duration_s))
        self.rows.append((work, operation, ticks, *scales))
        self.now_s += ticks


def draw_schedule(machine: Machine, days: int, rng: np.random.Generator) -> Schedule:
    """What the machine does in `days` days, from Monday 0 o'clock on."""
    operations = (*WARM_UP, *(operation for program in machine.programs for operation in program))
    first = np.cumsum([len(WARM_UP), *(len(program) for program in machine.programs)])
    stretches, worn_parts, batch, program, material = _Stretches(), int(rng.integers(0, 40)), 0, 0, 1.0
    for day in range(days):
        if day % 7 >= WORK_DAYS:
            continue
        stretches.add(Work.STANDING, -1, day * DAY_S + SHIFTS_S[0] + rng.uniform(0, 900) - stretches.now_s)
        for step in range(len(WARM_UP)):
            stretches.add(Work.WARM_UP, step, WARM_UP[step].duration_s)
        while stretches.now_s < day * DAY_S + SHIFTS_S[1]:
            is_first = batch == 0
            if is_first:
                batch, program = int(rng.integers(10, 61)), int(rng.integers(PROGRAMS))
                material = float(np.exp(rng.normal(0.0, 0.05)))
                stretches.add(Work.STANDING, -1, rng.uniform(300, 1500))
            scale = (material, 1.0 + 0.15 * worn_parts / 40)
            _part(stretches, machine, int(first[program]), program, scale=scale, is_first=is_first, rng=rng)
            batch, worn_parts = batch - 1, (worn_parts + 1) % 40
            if rng.random() < 0.02:
                stretches.add(Work.STANDING, -1, rng.uniform(600, 2400))
    stretches.add(Work.STANDING, -1, max(1, days * DAY_S - stretches.now_s))
    return _ticks(stretches, operations, machine, days * DAY_S, rng)


def _part(
    stretches: _Stretches,
    machine: Machine,
    first: int,
    program: int,
    *,
    scale: tuple[float, float],
    is_first: bool,
    rng: np.random.Generator,
) -> None:
    stretches.add(Work.LOADING, -1, rng.uniform(20, 60))
    for place, operation in enumerate(machine.programs[program]):
        stretches.add(Work.TOOL_CHANGE, first + place, 3 + machine.label_late_s * rng.uniform(0.8, 1.2) + rng.uniform(5, 9))
        override = 0.5 if is_first else float(rng.choice([1.0, 0.9, 0.8, 1.1], p=[0.94, 0.02, 0.02, 0.02]))
        chatter = float(rng.uniform(1.2, 1.6)) if rng.random() < 0.02 else 1.0
        load, vibration = scale[0] * scale[1] * override**0.7, scale[0] * scale[1] ** 1.5 * override**0.5 * chatter
        stretches.add(Work.RAPID, first + place, rng.uniform(3, 8))
        if rng.random() < (0.3 if is_first else 0.03):
            stretches.add(Work.STOP, first + place, rng.uniform(5, 30))
        stretches.add(Work.CUTTING, first + place, operation.duration_s / override, (load, override, vibration))


def _ticks(
    stretches: _Stretches, operations: tuple[Operation, ...], machine: Machine, ticks: int, rng: np.random.Generator
) -> Schedule:
    work, operation, lengths, *scales = (np.array(column) for column in zip(*stretches.rows, strict=True))
    starts = np.cumsum(lengths) - lengths
    each = np.repeat(np.arange(len(lengths)), lengths)[:ticks]
    since = np.arange(ticks) - starts[each]
    is_changing = work[each] == Work.TOOL_CHANGE
    late = machine.label_late_s * rng.uniform(0.8, 1.2, len(lengths))[each]
    told = is_changing & (since >= np.round(late) + 2) & (since < np.round(late) + 3) if machine.label_late_s else is_changing
    load, feed, vibration = (np.asarray(scale, dtype=np.float64)[each] for scale in scales)
    running = np.maximum(operation[np.maximum.accumulate(np.where(operation >= 0, np.arange(len(operation)), 0))], 0)
    sizes = [len(WARM_UP), *(len(program) for program in machine.programs)]
    program = np.repeat(np.arange(len(sizes)), sizes)
    tool = np.concatenate([np.arange(1, size + 1) for size in sizes])
    return Schedule(
        operations,
        work[each].astype(np.int8),
        operation[each].astype(np.int16),
        since.astype(np.int32),
        load,
        feed,
        vibration,
        program[running][each].astype(np.int16),
        tool[running][each].astype(np.int16),
        np.round(100.0 * feed),
        told,
        is_changing,
    )
