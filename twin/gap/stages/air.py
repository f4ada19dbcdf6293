"""The spindle's load in air: the meter beside idle power while the spindle turns steadily and nothing is cut.

    spindle_load_pct = 100 P_idle(n) / P_rated

A control that says speed, feed and load once a second says this much, without force, engagement or servo axes. Nothing is cut
while the feed stands still, while an axis goes at its rapid rate, where the planned depth is 0, and during a tool change. A row
counts where the spindle has the same speed at the rows before and after it. While it stands, its drive may be off, and nothing
is compared.

Rows that follow each other at one speed are one reading, their mean, of up to half a minute. Idle power may differ from what is
stated by two of its deviations. What is further off is an effect: in air nothing tells it from an idle power that is.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.case import Run, RunKind
from twin.effects.added import added_effects
from twin.effects.catalogue import effect_named
from twin.effects.effect import Effect, Guesses, Recorded
from twin.gap.diagnosis import Effected
from twin.gap.floors import Floors
from twin.gap.labels import regime_labels
from twin.gap.stages.cut import LOAD, acting
from twin.gap.stages.free import Free, constant
from twin.gap.stages.machine_terms import with_quantity_terms
from twin.gap.stages.observed_through import Sensing, sensor_effects, standing_sensors
from twin.gap.stages.rounded import as_read, coarse_step
from twin.gap.stages.stage import Model, Observed, observed_of
from twin.learned.arguments import around
from twin.learned.standing import added_series, terms_at
from twin.learned.term import Term
from twin.learned.words import LearnedSite
from twin.machine import MachineFile
from twin.runlog import RunLog
from twin.spindle.load import spindle_constants, spindle_load_pct, spindle_quantities

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
ENGAGED = ("axial_depth_mm", "force_x_n", "force_y_n")
READING_S = 30.0
ROWS_MIN = 5
"""Rows in air below which a run says nothing."""
STEADY = 0.01
"""Part of its speed by which a spindle may change from row to row and turn steadily."""
RAPID_PART = 0.9
"""Part of the rapid rate from which on nothing is cut."""
LIMIT_SIGMAS = 2.0
TERM_PART = 0.05
NOTICED = 0.1
"""Floors by which an effect of its usual size has to change the load in air to be looked for there."""


@dataclass(frozen=True, slots=True, eq=False)
class AirRun:
    """The readings in air of a run.

    rows: (n,) rows of the log that count; reading: (n,) the reading that each is part of; t_s, rpm, load: (readings,)
    """

    name: str
    log: RunLog
    rows: NDArray[np.intp]
    reading: NDArray[np.intp]
    t_s: Floats
    rpm: Floats
    load: Floats
    fitted: bool

    def means(self, column: Floats) -> Floats:
        """Return the mean of a column of the log over each reading, (readings,)."""
        return np.asarray(np.bincount(self.reading, column[self.rows]) / np.bincount(self.reading))


@dataclass(frozen=True, eq=False)
class AirStage:
    """The spindle's load in air of a case."""

    machine: MachineFile
    runs: tuple[AirRun, ...]
    floors: Floors
    left_out: frozenset[str] = frozenset()
    name: str = "spindle load in air"
    averaged: int = 1
    healthy_rms: float = 1.3
    observed: tuple[Observed, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "observed", tuple(self._observed(run) for run in self.runs))

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """Effects that act on the spindle."""
        return acting(spindle_quantities())

    @cached_property
    def standing(self) -> dict[str, Mapping[str, float]]:
        """Effects that the machine has already."""
        return added_effects(self.machine, spindle_quantities())

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Learned terms that the machine has already."""
        return terms_at(self.machine.learned, (LearnedSite.SPINDLE_POWER,))

    @property
    def constants(self) -> tuple[Free, ...]:
        """Idle power, within two stated deviations."""
        assert self.machine.spindle is not None
        stated = self.machine.uncertainty
        sigma = stated.get("spindle.idle_power_kw", stated.get("relative", 0.05))
        known = self.machine.spindle.idle_power_kw > 0.0 and sigma > 0.0
        return (constant("spindle.idle_power_kw", sigma, LIMIT_SIGMAS),) if known else ()

    @cached_property
    def candidates(self) -> tuple[Effected, ...]:
        """Return the effects that change the load of a spindle that turns in air, by its speeds here."""
        there = self.left_out | set(self.standing)
        found = [Effected(e.name) for e in self.effects if e.name not in there]
        has = standing_sensors(self.machine, LOAD)
        found += [e for e in sensor_effects((LOAD,), self.left_out) if e.effect not in has]
        return tuple(e for e in found if self._is_noticed(e))

    def _is_noticed(self, effected: Effected) -> bool:
        model = Model((), (effected,))
        typical = effect_named(effected.effect).typical_values()
        theta = np.array([[p.theta_of(typical[p.name.partition("__")[2]]) for p in model.free]])
        for number, observed in enumerate(self.observed):
            apart = self._read(model, theta, self.runs[number]) - self._read(Model((), ()), np.zeros((1, 0)), self.runs[number])
            if np.abs(apart / observed.floor).max(initial=0.0) > NOTICED:
                return not effect_named(effected.effect).shows_only_fast
        return False

    @property
    def term_sites(self) -> Mapping[LearnedSite, tuple[str, ...]]:
        """The site of learned terms that the load in air shows."""
        return {LearnedSite.SPINDLE_POWER: ("",)}

    def term_sizes(self, site: LearnedSite, on: str) -> float:
        """Return the size of a small term, a part of the rated power."""
        del site, on
        assert self.machine.spindle is not None
        return TERM_PART * max(self.machine.spindle.idle_power_kw, TERM_PART * self.machine.spindle.rated_power_kw)

    def term_arguments(self, run: int) -> Mapping[str, Floats]:
        """Return what a term may depend on in a run; of the load what the machine as stated shows."""
        return self._arguments(self.runs[run])

    def _arguments(self, run: AirRun) -> dict[str, Floats]:
        told = around(run.log.t_s, run.log.columns)
        found = {name: run.means(values) for name, values in told.items()}
        found["load_pct"] = self._bare(run)
        return found

    def _bare(self, run: AirRun) -> Floats:
        assert self.machine.spindle is not None
        constants: dict[str, ArrayLike] = dict(spindle_constants(self.machine.spindle))
        return np.asarray(spindle_load_pct(constants, np.zeros((1, len(run.rpm))), run.rpm)[0])

    def first_guesses(self, candidate: Effected) -> Guesses:
        """Return the effect's own guesses."""
        return effect_named(candidate.effect).first_guesses(Recorded(READING_S))

    def _observed(self, run: AirRun) -> Observed:
        floor = self.floors.of(run.log, LOAD)
        floor = run.means(floor)
        regime = regime_labels(run.log, LOAD, self.machine)[1][run.rows]
        first = np.searchsorted(run.reading, np.arange(len(run.rpm)))
        return observed_of(run.name, [(LOAD, run.load, floor, floor, np.arange(len(run.rpm)), regime[first])], run.fitted)

    def predict(self, model: Model, theta: Floats, run: int) -> Floats:
        """The load in air at each row of θ, (lanes, readings)."""
        return as_read(self.unrounded(model, theta, run), self.runs[run].load, self.step_of(run))

    def unrounded(self, model: Model, theta: Floats, run: int) -> Floats:
        """Return what `predict` returns, as it is between the steps of the meter."""
        return self._read(model, theta, self.runs[run])

    def step_of(self, run: int) -> float:
        """Return the step in which the meter was read."""
        data = self.runs[run]
        return coarse_step(data.log[LOAD][data.rows], self.observed[run].floor)

    def shown(self, model: Model, theta: Floats, run: int) -> Floats:
        """Return what the twin shows at the rows of the run that count, (n,), NaN at all others."""
        data = self.runs[run]
        column = np.full(len(data.log), np.nan)
        recorded = data.log[LOAD][data.rows]
        value = self._read(model, theta, data)[0][data.reading]
        column[data.rows] = as_read(value, recorded, coarse_step(recorded, self.observed[run].floor))
        return column

    def _read(self, model: Model, theta: Floats, run: AirRun) -> Floats:
        """Return the meter's readings, (lanes, readings)."""
        assert self.machine.spindle is not None
        one, factors = np.ones(len(theta)), model.factors(theta)
        constants: dict[str, ArrayLike] = {
            name: value * factors.get(f"spindle.{name}", one) for name, value in spindle_constants(self.machine.spindle).items()
        }
        constants |= model.effect_constants(theta, self.effects, self.standing)
        arguments = self._arguments(run) if self.terms or model.terms else {}
        added = with_quantity_terms(added_series(self.terms, arguments), model, theta, lambda: arguments)
        shown = spindle_load_pct(
            constants,
            np.zeros((len(theta), len(run.rpm))),
            run.rpm,
            period_s=READING_S,
            effects=tuple(e.name for e in self.effects),
            added_kw=added.get("electrical_power_kw"),
        )
        return Sensing.of(model.values(theta), LOAD, standing_sensors(self.machine, LOAD)).readings(shown, READING_S)


def air_runs(machine: MachineFile, runs: tuple[Run, ...]) -> tuple[AirRun, ...]:
    """Return the runs without servo axes in which the spindle turns in air for a while.

    A program of which nothing tells what it cuts stands in the stretch around it as well (`cnctwin gap case --store`). It is a
    run of its own for its repeats, and its load in air counts once: where other runs have it.
    """
    if machine.spindle is None:
        return ()
    alone = tuple(run for run in runs if run.entry.kind is not RunKind.CUT or any(run.log.has(name) for name in ENGAGED))
    found = []
    for run in alone or runs:
        log = run.log
        if log.axes() or not log.has(LOAD, "spindle_rpm"):
            continue
        rows = np.flatnonzero(_counts(log, machine))
        if len(rows) >= ROWS_MIN:
            found.append(_readings(run, rows))
    return tuple(found)


def _readings(run: Run, rows: NDArray[np.intp]) -> AirRun:
    """Join rows that follow each other at one speed."""
    log = run.log
    rpm, t_s = np.abs(log["spindle_rpm"][rows]), log.t_s[rows]
    begins = np.ones(len(rows), dtype=bool)
    begins[1:] = (np.diff(rows) > 1) | (np.abs(np.diff(rpm)) > STEADY * rpm[:-1])
    stretch = np.cumsum(begins) - 1
    since = t_s - t_s[begins][stretch]
    begins[1:] |= np.diff((since / READING_S).astype(np.intp)) != 0
    reading = np.cumsum(begins) - 1
    count = np.bincount(reading)
    time, speed, load = (np.asarray(np.bincount(reading, values) / count) for values in (t_s, rpm, log[LOAD][rows]))
    return AirRun(run.name, log, rows, reading, time, speed, load, run.entry.role == "fit")


def _counts(log: RunLog, machine: MachineFile) -> Bools:
    """Return True where the spindle turns in air, at the speed of the rows before and after, (n,)."""
    rpm, load = log["spindle_rpm"], log[LOAD]
    idle = in_air(log, machine)
    turns = np.isfinite(rpm) & np.isfinite(load) & (np.abs(np.nan_to_num(rpm)) > 0.0)
    here = idle & turns
    same = np.zeros(len(log), dtype=bool)
    with np.errstate(invalid="ignore"):
        same[1:] = np.abs(np.diff(rpm)) <= STEADY * np.abs(rpm[1:])
    after = np.roll(same, -1)
    after[-1:] = True
    return np.asarray(here & same & after)


def in_air(log: RunLog, machine: MachineFile) -> Bools:
    """Return True where a run says that nothing is cut, (n,); nowhere where it says neither feed nor depth."""
    nothing = np.zeros(len(log), dtype=bool)
    if log.has("feed_mm_min"):
        feed = log["feed_mm_min"]
        nothing |= feed == 0.0
        if machine.program is not None:
            nothing |= feed >= RAPID_PART * machine.program.rapid_mm_min
    if log.has("tool_change_active"):
        nothing |= np.nan_to_num(log["tool_change_active"]) > 0.0
    if log.has("axial_depth_mm"):
        depth = np.nan_to_num(log["axial_depth_mm"])
        nothing = depth == 0.0
    return nothing
