"""The gap of a twin on all runs of a case, over the floors that the case itself shows."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from twin.case import Case
from twin.errors import CaseError
from twin.gap.inspection import inspected
from twin.gap.score import gap_of, squares_of
from twin.gap.stages.plan import ground_of
from twin.gap.stages.shown import shown_by_run
from twin.gap.units import unit_of
from twin.machine import MachineFile
from twin.rotary import outside_names


@dataclass(frozen=True, slots=True)
class SignalScore:
    """The gap of one signal, in its unit."""

    rms: float
    floor: float
    unit: str


@dataclass(frozen=True, slots=True)
class Score:
    """gap: rms over the floor of all signals."""

    gap: float
    by_signal: Mapping[str, SignalScore]


def score_of(machine: MachineFile, case: Case, role: str | None = None) -> Score:
    """The gap of `machine` on the runs of `case`, or on those of one role, over the floor that the runs of the case show.

    Raises CaseError where no run records what the machine could be compared in.
    """
    checked, _ = inspected(replace(case, machine=machine))
    ground = ground_of(checked, frozenset())
    runs = tuple(run for run in ground.runs if role in (None, run.entry.role))
    squares = squares_of(runs, shown_by_run(ground.machine, runs, ground.floors), ground.floors)
    if not squares:
        raise CaseError(f"{case.name}: no run records a signal that {machine.machine.name} answers with")
    by_signal = {}
    for signal, found in squares.items():
        own = outside_names(signal, machine.rotary)
        by_signal[own] = SignalScore(found.rms(), found.floor(), unit_of(own))
    return Score(gap_of(squares), by_signal)
