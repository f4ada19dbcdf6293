"""A cell over some weeks: drawn from a seed, the readings of one machine at a time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulated_cell.disturbance import Disturbance, Kind, draw_disturbance, draw_disturbances
from benchmarks.simulated_cell.fault import LASTS_S, ONE_TOOL, PLANTED, SIZES, Fault, FaultKind, Overlap, draw_bursts
from benchmarks.simulated_cell.machine import Machine, draw_machine
from benchmarks.simulated_cell.part_program import Work, draw_program
from benchmarks.simulated_cell.schedule import DAY_S, KNOWN_PROGRAMS, SHIFTS_S, WORK_DAYS, Schedule, draw_schedule
from benchmarks.simulated_cell.signals import Readings, readings, weather
from benchmarks.simulated_cell.tooling import draw_tools

SLOTS_A_DAY = 3
FAULTS_A_DAY = 9
"""In the whole cell, so that a machine's peers are mostly sound, whatever their number; at most one in each slot of a machine."""
LATE_LABELS = 4
"""One machine in so many tells late of its tool changes."""
AROUND_S = 120.0
CUTTING_SHARE_MIN = 0.4
"""Share of its time in which a machine cuts where a fault is planted: one that breaks while it stands shows nothing."""
USE_S_MIN = 20
"""A fault of one tool begins where that tool goes on cutting for so long."""


@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """seed: of everything in it. Faults are planted from `faults_from_day` on."""

    seed: int
    machines: tuple[Machine, ...]
    schedules: tuple[Schedule, ...]
    disturbances: tuple[Disturbance, ...]
    faults: tuple[Fault, ...]
    days: int
    faults_from_day: int


def draw_cell(seed: int, machines: int, days: int, faults_from_day: int, *, has_worn_bearing: bool = False) -> Cell:
    """A cell of N machines, from Monday 0 o'clock on.

    From `faults_from_day` on it has nine faults a working day (at most three a machine), of a machine, size and overlap that are
    drawn; the kinds take turns. Before, all is the same without them, so that a week without faults has as many disturbances.
    From the second of these days on a machine runs a new program, too. Of two neighbours one program is the same.
    has_worn_bearing: instead of all these, a bearing of one machine that starts to go on the first of these days
    """
    tools = draw_tools(_rng(seed, 7))
    names = [[f"O{1000 * (place + 1) + number}" for number in range(KNOWN_PROGRAMS + 1)] for place in range(machines)]
    drawn_programs = [
        [draw_program(name, tools, _rng(seed, 8, place, k)) for k, name in enumerate(own)] for place, own in enumerate(names)
    ]
    for place in range(1, machines, 2):
        drawn_programs[place][0] = drawn_programs[place - 1][0]
    built = tuple(
        draw_machine(tuple(own), tools, _rng(seed, 1, place), is_late=place % LATE_LABELS == LATE_LABELS - 1)
        for place, own in enumerate(drawn_programs)
    )
    new_from = faults_from_day + 1
    schedules = tuple(draw_schedule(machine, days, _rng(seed, 2, place), new_from) for place, machine in enumerate(built))
    disturbances = draw_disturbances(machines, days, _rng(seed, 3))
    if has_worn_bearing:
        faults: tuple[Fault, ...] = (_worn_bearing(machines, days, faults_from_day, _rng(seed, 9)),)
        return Cell(seed, built, schedules, disturbances, faults, days, faults_from_day)
    drawn, over = _plant(schedules, days, _rng(seed, 4))
    faults = tuple(fault for fault in drawn if fault.start_s >= faults_from_day * DAY_S)
    together = tuple(sorted((*disturbances, *over), key=lambda one: one.start_s))
    return Cell(seed, built, schedules, together, faults, days, faults_from_day)


def machine_readings(cell: Cell, place: int, *, with_faults: bool = True) -> Readings:
    """Return the readings of one machine, one row a second."""
    return readings(
        cell.machines[place],
        cell.schedules[place],
        place,
        hall_temp_c=weather(cell.days * DAY_S, _rng(cell.seed, 6)),
        disturbances=cell.disturbances,
        faults=cell.faults if with_faults else (),
        rng=_rng(cell.seed, 5, place),
    )


def _rng(*key: int) -> np.random.Generator:
    return np.random.default_rng(key)


def _worn_bearing(machines: int, days: int, from_day: int, rng: np.random.Generator) -> Fault:
    place, size, start_s = int(rng.integers(machines)), float(rng.choice(SIZES)), from_day * DAY_S + SHIFTS_S[0] + 3600.0
    return Fault(place, FaultKind.WORN_BEARING, size, start_s, min(days * DAY_S, start_s + 5.0 * DAY_S), Overlap.NONE)


def _plant(
    schedules: Sequence[Schedule], days: int, rng: np.random.Generator
) -> tuple[tuple[Fault, ...], tuple[Disturbance, ...]]:
    faults: list[Fault] = []
    over: list[Disturbance] = []
    slot_s = (SHIFTS_S[1] - SHIFTS_S[0] - 7200) / SLOTS_A_DAY
    overlaps, slots = list(Overlap), len(schedules) * SLOTS_A_DAY
    turns = int(rng.integers(len(PLANTED)))
    for day in (day for day in range(days) if day % 7 < WORK_DAYS):
        for drawn in rng.choice(slots, size=min(FAULTS_A_DAY, slots), replace=False):
            place, slot = divmod(int(drawn), SLOTS_A_DAY)
            kind, overlap = PLANTED[turns % len(PLANTED)], overlaps[int(rng.integers(len(overlaps)))]
            turns += 1
            earliest = day * DAY_S + SHIFTS_S[0] + 3600 + slot * slot_s
            lasts_s = float(rng.uniform(*LASTS_S[kind]))
            start_s = _start(schedules, place, (earliest, earliest + slot_s - lasts_s - 900, lasts_s), kind, overlap, rng=rng)
            size = 1.0 if kind is FaultKind.BROKEN_TOOL else float(rng.choice(SIZES))
            fault = Fault(place, kind, size, start_s, start_s + lasts_s, overlap)
            fault = _completed(fault, schedules[place], rng)
            faults.append(fault)
            if overlap is Overlap.DISTURBANCE:
                over.append(_disturbance_over(fault, len(schedules), rng))
    return tuple(faults), tuple(over)


def _completed(fault: Fault, own: Schedule, rng: np.random.Generator) -> Fault:
    """The fault with its bursts, its tool, or the end of the part in which it ends."""
    at = int(fault.start_s)
    if fault.kind is FaultKind.INTERMITTENT:
        return replace(fault, bursts_s=draw_bursts(fault.end_s - fault.start_s, rng))
    if fault.kind in ONE_TOOL:
        return replace(fault, tool=int(own.tool_number[at]))
    if fault.kind is FaultKind.WRONG_MATERIAL:
        ends = [part.end_s for part in own.parts if part.end_s > fault.start_s + 60.0][:2]
        return replace(fault, end_s=float(ends[min(len(ends) - 1, int(rng.integers(2)))]) if ends else fault.end_s)
    return fault


def _start(
    schedules: Sequence[Schedule],
    place: int,
    within_s: tuple[float, float, float],
    kind: FaultKind,
    overlap: Overlap,
    *,
    rng: np.random.Generator,
) -> float:
    """When the fault begins: so that the machine cuts in enough of its time; within a tool change, where that is asked for.

    within_s: earliest and latest start, and how long it lasts
    """
    earliest, latest, lasts_s = (int(given) for given in within_s)
    part = slice(earliest, max(earliest + 1, latest))
    own = schedules[place]
    cut = np.cumsum(own.work[earliest : part.stop + lasts_s] == Work.CUTTING)
    wanted = cut[lasts_s:] - cut[: len(cut) - lasts_s] >= CUTTING_SHARE_MIN * lasts_s
    changing = [schedule.is_changing[part] for schedule in schedules]
    begins = _begins(kind, own, part, overlap)
    if begins is not None:
        wanted = wanted & begins if (wanted & begins).any() else begins
    elif overlap is Overlap.OWN_CHANGE:
        wanted = wanted & changing[place]
    if overlap is Overlap.PEER_CHANGE and len(schedules) > 1:
        beside = wanted & np.any([*changing[:place], *changing[place + 1 :]], axis=0)
        wanted = beside if beside.any() else wanted
    choices = np.flatnonzero(wanted)
    return float(part.start + (choices[int(rng.integers(len(choices)))] if len(choices) else 0))


def _begins(kind: FaultKind, own: Schedule, part: slice, overlap: Overlap) -> NDArray[np.bool_] | None:
    """The seconds at which a kind can begin that cannot at any; None = it can."""
    if kind is FaultKind.WRONG_MATERIAL:
        begins = np.zeros(len(own.work), dtype=np.bool_)
        begins[[int(one.start_s) + 1 for one in own.parts]] = True
        return begins[part]
    if kind not in ONE_TOOL and kind is not FaultKind.COOLANT_OFF:
        return None
    wet = np.array([one.is_wet for one in own.operations])
    depths = np.array([min((cut.depth_mm for cut in one.cuts), default=np.inf) for one in own.operations])
    least = np.array([depths[own.program_of == program].min() for program in own.program_of])
    fits = np.isfinite(depths) & ((depths <= least) | (kind is not FaultKind.TOOL_TOO_LONG))
    fits &= wet | (kind is not FaultKind.COOLANT_OFF)
    operation = own.operation[part]
    fitting = (operation >= 0) & fits[operation]
    if overlap is Overlap.OWN_CHANGE:
        return np.asarray(fitting & own.is_changing[part])
    later = slice(part.start + USE_S_MIN, part.stop + USE_S_MIN)
    cuts_on = (own.work[part] == Work.CUTTING) & (own.work[later] == Work.CUTTING) & (operation == own.operation[later])
    return np.asarray(fitting & cuts_on)


def _disturbance_over(fault: Fault, machines: int, rng: np.random.Generator) -> Disturbance:
    kind = (Kind.PRESS, Kind.COOLANT, Kind.HEAT)[int(rng.integers(3))]
    lasts_s = fault.end_s - fault.start_s + 2 * AROUND_S
    return draw_disturbance(kind, fault.start_s - AROUND_S, lasts_s, rng.normal(0.0, 0.35, machines), rng)
