"""The spindle's heat, driven by the recorded load, speed, coolant and surroundings."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.case import Run
from twin.effects.added import added_effects
from twin.effects.catalogue import effect_named
from twin.effects.effect import Effect, Excitation, Guesses, Recorded
from twin.gap.diagnosis import Effected
from twin.gap.floors import Floors
from twin.gap.labels import regime_labels
from twin.gap.stages.cut import acting
from twin.gap.stages.free import Free, constant
from twin.gap.stages.machine_terms import reading_of_terms, with_quantity_terms
from twin.gap.stages.observed_through import Sensing, sensor_effects
from twin.gap.stages.stage import Model, Observed, observed_of
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants, thermal_quantities
from twin.identification.batch_fit import time_blocks
from twin.learned.arguments import around
from twin.learned.standing import added_series, reading_series, terms_at
from twin.learned.term import Term
from twin.learned.words import LearnedSite
from twin.machine import MachineFile
from twin.runlog import RunLog
from twin.simulator.recorded import start_temperature_c

Floats = NDArray[np.float64]
BLOCK_S = 120.0
SIGNAL = "spindle_temp_c"
NAMES = ("alpha_w_per_pct_rpm2", "beta_w_per_rpm", "resistance_k_per_w", "capacity_j_per_k")
TERM_FLOORS = 3.0
NEEDS = (SIGNAL, "spindle_rpm", "spindle_load_pct", "ambient_temp_c")


@dataclass(frozen=True, slots=True, eq=False)
class HeatRun:
    """A run that warms up or cools down."""

    name: str
    log: RunLog
    warming: Warming
    fitted: bool


@dataclass(frozen=True, eq=False)
class HeatStage:
    """The spindle's heat in a case."""

    machine: MachineFile
    runs: tuple[HeatRun, ...]
    floors: Floors
    left_out: frozenset[str] = frozenset()
    name: str = "spindle heat"
    averaged: int = 2
    healthy_rms: float = 1.3
    observed: tuple[Observed, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "observed", tuple(self._observed(run) for run in self.runs))

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """Effects that act on the heat."""
        return acting(thermal_quantities())

    @cached_property
    def standing(self) -> dict[str, Mapping[str, float]]:
        """Effects that the machine has already."""
        return added_effects(self.machine, thermal_quantities())

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Learned terms that the machine has already."""
        sites = (LearnedSite.HEAT_INPUT, LearnedSite.HEAT_LOSS, LearnedSite.TEMPERATURE_READING)
        return terms_at(self.machine.learned, sites)

    @property
    def constants(self) -> tuple[Free, ...]:
        """Heat by load and by speed, resistance, capacity: only their ratios show, so their priors say the rest."""
        assert self.machine.thermal is not None
        stated, thermal = self.machine.uncertainty, self.machine.thermal.model_dump()
        relative = stated.get("relative", 0.05)
        free = [constant(f"thermal.{n}", stated.get(f"thermal.{n}", relative)) for n in NAMES if thermal[n] > 0.0]
        return tuple(p for p in free if p.sigma > 0.0)

    @property
    def candidates(self) -> tuple[Effected, ...]:
        """Return the effects that the temperature can show; those of the coolant only where it was switched."""
        switched = any(len(set(np.nan_to_num(np.asarray(r.warming.coolant_on)).tolist())) > 1 for r in self.runs if r.fitted)
        found = []
        for effect in self.effects:
            excited = effect.excited_by is not Excitation.COOLANT_SWITCHED or switched
            if effect.name not in self.left_out | set(self.standing) and excited:
                found.append(Effected(effect.name))
        return (*found, *sensor_effects((SIGNAL,), self.left_out))

    @property
    def term_sites(self) -> Mapping[LearnedSite, tuple[str, ...]]:
        """The sites of learned terms that the temperature shows."""
        return {LearnedSite.HEAT_INPUT: ("",), LearnedSite.HEAT_LOSS: ("",), LearnedSite.TEMPERATURE_READING: ("",)}

    def term_sizes(self, site: LearnedSite, on: str) -> float:
        """Return the size of a small term: what warms the spindle by a degree, or a few floors of the reading."""
        del on
        assert self.machine.thermal is not None
        if site is LearnedSite.TEMPERATURE_READING:
            return TERM_FLOORS * float(np.nanmedian(self.floors.of(self.runs[0].log, SIGNAL)))
        return 1.0 / self.machine.thermal.resistance_k_per_w

    def term_arguments(self, run: int) -> Mapping[str, Floats]:
        """Return what a term may depend on in a run."""
        return around(self.runs[run].log.t_s, self.runs[run].log.columns)

    def first_guesses(self, candidate: Effected) -> Guesses:
        """Return the effect's own guesses."""
        return effect_named(candidate.effect).first_guesses(Recorded(float(np.median(np.diff(self.runs[0].log.t_s)))))

    def _observed(self, run: HeatRun) -> Observed:
        floor = self.floors.of(run.log, SIGNAL)
        blocks = time_blocks(run.log.t_s, BLOCK_S)
        regime = regime_labels(run.log, SIGNAL, self.machine)[1]
        return observed_of(run.name, [(SIGNAL, run.log[SIGNAL], floor, floor, blocks, regime)], run.fitted)

    def predict(self, model: Model, theta: Floats, run: int) -> Floats:
        """The temperature at each row of θ, (lanes, n)."""
        assert self.machine.thermal is not None
        data = self.runs[run]
        values, factors = model.values(theta), model.factors(theta)
        constants: dict[str, ArrayLike] = {}
        for name, value in thermal_constants(self.machine.thermal).items():
            key = "capacity_j_per_k" if name == "heat_capacity_j_per_k" else name
            constants[name] = value * factors.get(f"thermal.{key}", np.ones(len(theta)))
        constants |= model.effect_constants(theta, self.effects, self.standing)
        sensing = Sensing.of(values, SIGNAL)
        start = sensing.value(np.full(len(theta), start_temperature_c(data.log.t_s, data.log[SIGNAL])))
        arguments = around(data.log.t_s, data.log.columns) if self.terms or model.terms else {}
        added = with_quantity_terms(added_series(self.terms, arguments), model, theta, lambda: arguments)
        shown = spindle_temperature_c(
            constants,
            data.warming,
            start,
            effects=tuple(e.name for e in self.effects),
            added_w=added.get("heat_w"),
        )
        learned = reading_series(self.terms, SIGNAL, arguments)
        period_s = float(np.median(np.diff(data.log.t_s)))
        read = sensing.readings(np.broadcast_to(shown, (len(theta), shown.shape[1])), period_s)
        read = read + reading_of_terms(model, theta, SIGNAL, lambda: arguments)
        return read if learned is None else read + learned


def heat_runs(machine: MachineFile, runs: tuple[Run, ...]) -> tuple[HeatRun, ...]:
    """The runs in which the spindle's temperature is recorded beside all that drives it."""
    if machine.thermal is None:
        return ()
    found = []
    for run in runs:
        log = run.log
        if log.has(*NEEDS):
            coolant = log["coolant_on"] if log.has("coolant_on") else np.zeros(len(log))
            warming = Warming(log.t_s, log["spindle_load_pct"], log["spindle_rpm"], log["ambient_temp_c"], coolant)
            found.append(HeatRun(run.name, log, warming, run.entry.role == "fit"))
    return tuple(found)
