"""The lengths of tool changes, where no program says what else happens: from the stopped spindle to the tool in it.

    length = tool_change_s · factor, through the effects that change it

A control that says when a tool change is in progress says this much at any rate. Where it is read at even times, a length is
known to a sample period at either end; where it is recorded as it changes, the rows at its ends say when it changed. Changes
differ among themselves; by how much is their floor. One that takes several times as long as the others had a person in it, and
is left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twin.case import Run
from twin.effects.added import added_effects
from twin.effects.catalogue import catalogue, effect_named
from twin.effects.effect import Effect, Guesses, called
from twin.gap.diagnosis import Effected
from twin.gap.stages.free import Free, constant
from twin.gap.stages.stage import Model, Observed, observed_of
from twin.machine import MachineFile
from twin.runlog import RunLog
from twin.simulator.recorded import MEDIAN_TO_SIGMA

Floats = NDArray[np.float64]
SIGNAL, QUANTITY = "tool_change_s", "tool_change_s"
CHANGES_MIN = 3
LONG = 3.0
"""Times the usual length from which on somebody was in a change."""
HOLE_PERIODS = 5.0
EVEN = 2.0
"""Times the short distances of two rows that the long ones are at most, where rows are even: else they are of what changed."""
COARSE = 1.0 / 3.0
"""Part of a change up to which rows may be apart: in coarser ones, which hold mean speeds, no end of a change can be seen."""
FLOOR_S = 0.05
TURNS_RPM = 30.0


@dataclass(frozen=True, slots=True, eq=False)
class ChangeRun:
    """The tool changes of a run. lengths_s: (n,); period_s: of its rows around them, 0 where it is recorded as it changes"""

    name: str
    lengths_s: Floats
    period_s: float
    fitted: bool


@dataclass(frozen=True, eq=False)
class ToolChangeStage:
    """The tool changes of a case."""

    machine: MachineFile
    runs: tuple[ChangeRun, ...]
    left_out: frozenset[str] = frozenset()
    name: str = "tool changes"
    averaged: int = 1
    healthy_rms: float = 1.5
    observed: tuple[Observed, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "observed", tuple(self._observed(run) for run in self.runs))

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """Effects that change how long a tool change takes."""
        return tuple(effect for effect in catalogue().values() if QUANTITY in effect.changes)

    @cached_property
    def standing(self) -> dict[str, Mapping[str, float]]:
        """Effects that the machine has already."""
        return added_effects(self.machine, (QUANTITY,))

    @property
    def constants(self) -> tuple[Free, ...]:
        """The stated length."""
        stated = self.machine.uncertainty
        sigma = stated.get(f"program.{QUANTITY}", stated.get("relative", 0.05))
        return (constant(f"program.{QUANTITY}", sigma),) if sigma > 0.0 else ()

    @property
    def candidates(self) -> tuple[Effected, ...]:
        """Return those that the machine does not have."""
        return tuple(Effected(e.name) for e in self.effects if e.name not in self.left_out | set(self.standing))

    def first_guesses(self, candidate: Effected) -> Guesses:
        """Start from what the changes seem to be off, in the parameters that lengthen one; nothing else of the effect shows."""
        effect = effect_named(candidate.effect)
        function = effect.changes[QUANTITY]
        taken = function.__code__.co_varnames[1 : function.__code__.co_argcount]
        return tuple({p.name: part * p.typical for p in effect.parameters if p.name in taken} for part in (1.0, 0.2))

    @property
    def floor_s(self) -> float:
        """The spread of the machine's changes, and of what the rows do not tell of one."""
        spread = [run.lengths_s - np.median(run.lengths_s) for run in self.runs]
        usual = MEDIAN_TO_SIGMA * float(np.median(np.abs(np.concatenate(spread))))
        told = max(run.period_s for run in self.runs) / np.sqrt(6.0)
        return float(max(usual, told, FLOOR_S))

    def _observed(self, run: ChangeRun) -> Observed:
        count = len(run.lengths_s)
        floor, place = np.full(count, self.floor_s), np.arange(count)
        return observed_of(run.name, [(SIGNAL, run.lengths_s, floor, floor, place, np.zeros(count, dtype=np.int8))], run.fitted)

    def predict(self, model: Model, theta: Floats, run: int) -> Floats:
        """The lengths at each row of θ, (lanes, changes)."""
        assert self.machine.program is not None
        lengths = self.machine.program.tool_change_s * model.factors(theta).get(f"program.{QUANTITY}", np.ones(len(theta)))
        given = model.effect_constants(theta, self.effects, self.standing)
        for effect in self.effects:
            own = {p.name: given[f"{effect.name}__{p.name}"] for p in effect.parameters}
            lengths = np.asarray(called(effect.changes[QUANTITY], own, lengths))
        return np.tile(lengths[:, None], (1, len(self.runs[run].lengths_s)))


def change_runs(machine: MachineFile, runs: tuple[Run, ...]) -> tuple[ChangeRun, ...]:
    """Return the runs that say when a tool change is in progress, where there are a few, without changes with people in them."""
    if machine.program is None or machine.program.tool_change_s <= 0.0:
        return ()
    found = [(run, *lengths_of(run.log)) for run in runs if not run.log.axes() and run.log.has("tool_change_active")]
    found = [(run, some, p) for run, some, p in found if len(some) and p <= COARSE * float(np.median(some))]
    every = np.concatenate([lengths for _, lengths, _ in found]) if found else np.zeros(0)
    if not len(every):
        return ()
    longest = LONG * float(np.median(every))
    kept = [ChangeRun(run.name, some[some <= longest], p, run.entry.role == "fit") for run, some, p in found]
    return tuple(run for run in kept if len(run.lengths_s) >= CHANGES_MIN)


def lengths_of(log: RunLog) -> tuple[Floats, float]:
    """Return the lengths of the tool changes that a run has whole, s, and the period of its rows, 0 where they are not even.

    >>> from twin.runlog import run_log
    >>> active = np.array([0, 0, 1, 1, 1, 0, 0, 1])
    >>> lengths, period_s = lengths_of(run_log({"t_s": np.arange(8.0), "tool_change_active": active}))
    >>> lengths.tolist(), period_s
    ([3.0], 1.0)
    >>> uneven_s = np.array([0.0, 5.0, 6.0, 9.2, 10.0, 15.0, 20.0])
    >>> active = np.array([0, 0, 1, 0, 0, 0, 0])
    >>> lengths, period_s = lengths_of(run_log({"t_s": uneven_s, "tool_change_active": active}))
    >>> lengths.round(6).tolist(), period_s
    ([3.2], 0.0)
    """
    told = np.flatnonzero(np.isfinite(log["tool_change_active"]))
    t_s, active = log.t_s[told], log["tool_change_active"][told] > 0.0
    if len(t_s) < 3:
        return np.zeros(0), 0.0
    apart = np.diff(t_s)
    period_s = float(np.median(apart))
    short_s, long_s = (float(np.quantile(apart, part)) for part in (0.2, 0.8))
    is_even = long_s <= EVEN * short_s
    hole_s = HOLE_PERIODS * (period_s if is_even else long_s)
    rpm = np.abs(np.nan_to_num(log["spindle_rpm"][told])) if log.has("spindle_rpm") else np.zeros(len(told))
    inside = active & (rpm < TURNS_RPM)
    begins, ends = (np.flatnonzero(np.diff(inside.astype(np.int8)) == way) + 1 for way in (1, -1))
    lengths = []
    for begin in begins:
        after = ends[ends > begin]
        if not len(after) or active[after[0]] or (active[begin - 1] and not is_even):
            continue  # it has no end, or in rows of what changed nobody told when the spindle came to rest in it
        end = int(after[0])
        if apart[begin - 1 : end].max() <= hole_s:
            # in even rows, a change begins and ends somewhere between two of them
            half_s = 0.5 * (apart[end - 1] - apart[begin - 1]) if is_even else 0.0
            lengths.append(t_s[end] - t_s[begin] - half_s)
    return np.array(lengths), period_s if is_even else 0.0
