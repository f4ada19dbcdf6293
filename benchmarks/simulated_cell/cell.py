"""A cell over some weeks: drawn from a seed, the signals of one machine at a time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulated_cell.disturbance import Disturbance, Kind, draw_disturbance, draw_disturbances
from benchmarks.simulated_cell.fault import LASTS_S, SIZES, Fault, FaultKind, Overlap, draw_bursts
from benchmarks.simulated_cell.part_program import Work
from benchmarks.simulated_cell.schedule import DAY_S, SHIFTS_S, WORK_DAYS, Machine, Schedule, draw_machine, draw_schedule
from benchmarks.simulated_cell.signals import signals, weather

SLOTS_A_DAY = 3
FAULTS_A_DAY = 9
"""In the whole cell, so that a machine's peers are mostly sound, whatever their number; at most one in each slot of a machine."""
LATE_LABELS = 4
"""One machine in so many tells late of its tool changes."""
AROUND_S = 120.0
CUTTING_SHARE_MIN = 0.4
"""What breaks while a machine stands shows nothing; a fault is planted where the machine cuts in so much of its time."""


@dataclass(frozen=True, slots=True)
class Cell:
    """seed: of everything in it. Faults are planted from `faults_from_day` on."""

    seed: int
    machines: tuple[Machine, ...]
    schedules: tuple[Schedule, ...]
    disturbances: tuple[Disturbance, ...]
    faults: tuple[Fault, ...]
    days: int
    faults_from_day: int


def draw_cell(seed: int, machines: int, days: int, faults_from_day: int) -> Cell:
    """A cell of N machines, from Monday 0 o'clock on.

    From `faults_from_day` on it has nine faults a working day (at most three a machine), of a machine, size and overlap that are
    drawn; the kinds take turns. Before, all is the same without them, so that a week without faults has as many disturbances.
    """
    built = tuple(draw_machine(_rng(seed, 1, place), place % LATE_LABELS == LATE_LABELS - 1) for place in range(machines))
    schedules = tuple(draw_schedule(machine, days, _rng(seed, 2, place)) for place, machine in enumerate(built))
    disturbances = draw_disturbances(machines, days, _rng(seed, 3))
    drawn, over = _plant(schedules, days, _rng(seed, 4))
    faults = tuple(fault for fault in drawn if fault.start_s >= faults_from_day * DAY_S)
    together = tuple(sorted((*disturbances, *over), key=lambda one: one.start_s))
    return Cell(seed, built, schedules, together, faults, days, faults_from_day)


def machine_signals(cell: Cell, place: int, *, with_faults: bool = True) -> NDArray[np.float64]:
    """(T, 5) of one machine, one row a second, in the order of `FEATURES`."""
    faults = cell.faults if with_faults else ()
    return signals(
        cell.machines[place],
        cell.schedules[place],
        place,
        hall_temp_c=weather(cell.days * DAY_S, _rng(cell.seed, 6)),
        disturbances=cell.disturbances,
        faults=faults,
        rng=_rng(cell.seed, 5, place),
    )


def _rng(*key: int) -> np.random.Generator:
    return np.random.default_rng(key)


def _plant(
    schedules: Sequence[Schedule], days: int, rng: np.random.Generator
) -> tuple[tuple[Fault, ...], tuple[Disturbance, ...]]:
    faults: list[Fault] = []
    over: list[Disturbance] = []
    slot_s = (SHIFTS_S[1] - SHIFTS_S[0] - 7200) / SLOTS_A_DAY
    kinds, overlaps, slots = list(FaultKind), list(Overlap), len(schedules) * SLOTS_A_DAY
    for day in (day for day in range(days) if day % 7 < WORK_DAYS):
        for drawn in rng.choice(slots, size=min(FAULTS_A_DAY, slots), replace=False):
            place, slot = divmod(int(drawn), SLOTS_A_DAY)
            kind, overlap = kinds[len(faults) % len(kinds)], overlaps[int(rng.integers(len(overlaps)))]
            earliest = day * DAY_S + SHIFTS_S[0] + 3600 + slot * slot_s
            lasts_s = float(rng.uniform(*LASTS_S[kind]))
            start_s = _start(schedules, place, (earliest, earliest + slot_s - lasts_s - 900, lasts_s), overlap, rng)
            fault = Fault(place, kind, float(rng.choice(SIZES)), start_s, start_s + lasts_s, overlap)
            if kind is FaultKind.INTERMITTENT:
                fault = replace(fault, bursts_s=draw_bursts(lasts_s, rng))
            faults.append(fault)
            if overlap is Overlap.DISTURBANCE:
                over.append(_disturbance_over(fault, len(schedules), rng))
    return tuple(faults), tuple(over)


def _start(
    schedules: Sequence[Schedule], place: int, within_s: tuple[float, float, float], overlap: Overlap, rng: np.random.Generator
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
    if overlap is Overlap.OWN_CHANGE:
        wanted = wanted & changing[place]
    elif overlap is Overlap.PEER_CHANGE and len(schedules) > 1:
        wanted = wanted & np.any([*changing[:place], *changing[place + 1 :]], axis=0)
    choices = np.flatnonzero(wanted)
    return float(part.start + (choices[int(rng.integers(len(choices)))] if len(choices) else 0))


def _disturbance_over(fault: Fault, machines: int, rng: np.random.Generator) -> Disturbance:
    kind = (Kind.PRESS, Kind.COOLANT, Kind.HEAT)[int(rng.integers(3))]
    lasts_s = fault.end_s - fault.start_s + 2 * AROUND_S
    return draw_disturbance(kind, fault.start_s - AROUND_S, lasts_s, rng.normal(0.0, 0.35, machines), rng)
