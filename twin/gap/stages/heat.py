"""The spindle's heat, driven by the recorded load, speed, coolant and surroundings."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.assumed import is_assumed
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
from twin.gap.stages.observed_through import Sensing, sensor_effects, standing_sensors
from twin.gap.stages.rounded import as_read, coarse_step
from twin.gap.stages.stage import Model, Observed, observed_of
from twin.gap.stages.warming import NEEDS, SIGNAL, Stretch, Warmed, behind_k, between, from_rest, read_from, stretches_of
from twin.heat.run import spindle_temperature_c, thermal_constants, thermal_quantities
from twin.identification.batch_fit import time_blocks
from twin.learned.arguments import around
from twin.learned.standing import added_series, reading_series, terms_at
from twin.learned.term import Term
from twin.learned.words import LearnedSite
from twin.machine import MachineFile
from twin.runlog import RunLog

Floats = NDArray[np.float64]
BLOCK_S, BLOCKS_MIN = 120.0, 12
CAPACITY = "capacity_j_per_k"
NAMES = ("alpha_w_per_pct_rpm2", "beta_w_per_rpm", "resistance_k_per_w", CAPACITY)
TERM_FLOORS = 3.0
LATE_PART = 2.0
"""The factor by which a spindle may be further ahead of a late sensor, or less, at the start: it has not warmed evenly."""
BENT_PART = 2.0
"""Standard deviations of the readings that a stretch begins with by which its start may be off a line through them."""


@dataclass(frozen=True, slots=True, eq=False)
class HeatRun:
    """A run that warms up or cools down. parts: stretches without a hole in them, each of which starts as it was measured"""

    name: str
    log: RunLog
    parts: tuple[Stretch, ...]
    fitted: bool

    @property
    def t_s(self) -> Floats:
        """Times at which it is compared, (n,)."""
        return np.concatenate([part.at_s for part in self.parts])

    def means(self, values: Floats) -> Floats:
        """Return a column of its log as it is compared, (n,)."""
        return np.concatenate([part.means(values) for part in self.parts])


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
        """Heat by load and by speed, resistance, capacity: only their ratios show, so their priors say the rest.

        A capacity that is only assumed is the measure of the others, and stays.
        """
        assert self.machine.thermal is not None
        stated, thermal = self.machine.uncertainty, self.machine.thermal.model_dump()
        relative = stated.get("relative", 0.05)
        there = [n for n in NAMES if thermal[n] > 0.0 and not (n == CAPACITY and is_assumed(self.machine, f"thermal.{n}"))]
        free = [constant(f"thermal.{n}", stated.get(f"thermal.{n}", relative)) for n in there]
        return tuple(p for p in free if p.sigma > 0.0)

    @property
    def candidates(self) -> tuple[Effected, ...]:
        """Return the effects that the temperature can show; those of the coolant only where it was switched."""
        switched = any(part.switches_coolant for r in self.runs if r.fitted for part in r.parts)
        found = []
        for effect in self.effects:
            excited = effect.excited_by is not Excitation.COOLANT_SWITCHED or switched
            if effect.name not in self.left_out | set(self.standing) and excited:
                found.append(Effected(effect.name))
        has = standing_sensors(self.machine, SIGNAL)
        return (*found, *(e for e in sensor_effects((SIGNAL,), self.left_out) if e.effect not in has))

    @property
    def lasts_s(self) -> float:
        """Seconds of the longest stretch that is compared."""
        return max((float(part.at_s[-1] - part.at_s[0]) for run in self.runs for part in run.parts), default=0.0)

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
        return self._arguments(self.runs[run])

    def _arguments(self, run: HeatRun) -> dict[str, Floats]:
        told = around(run.log.t_s, run.log.columns)
        return {name: run.means(values) for name, values in told.items()}

    def first_guesses(self, candidate: Effected) -> Guesses:
        """Return the effect's own guesses."""
        return effect_named(candidate.effect).first_guesses(Recorded(float(np.median(np.diff(self.runs[0].log.t_s)))))

    def _observed(self, run: HeatRun) -> Observed:
        t_s, floor = run.t_s, run.means(self.floors.of(run.log, SIGNAL))
        blocks = time_blocks(t_s, min(BLOCK_S, float(t_s[-1] - t_s[0]) / BLOCKS_MIN))
        regime = regime_labels(run.log, SIGNAL, self.machine)[1]
        first = np.concatenate([part.first for part in run.parts])
        return observed_of(run.name, [(SIGNAL, run.means(run.log[SIGNAL]), floor, floor, blocks, regime[first])], run.fitted)

    def predict(self, model: Model, theta: Floats, run: int) -> Floats:
        """The temperature at each row of θ, (lanes, n)."""
        return as_read(self.unrounded(model, theta, run), self.observed[run].measured, self.step_of(run))

    def unrounded(self, model: Model, theta: Floats, run: int) -> Floats:
        """Return what `predict` returns, as it is between the steps of the reading."""
        return np.concatenate(self._read(model, theta, run), axis=1)

    def step_of(self, run: int) -> float:
        """Return the step in which the temperature was read."""
        return self._steps[run]

    @cached_property
    def _steps(self) -> tuple[float, ...]:
        return tuple(coarse_step(r.log[SIGNAL], o.floor) for r, o in zip(self.runs, self.observed, strict=True))

    @cached_property
    def _log_steps(self) -> tuple[float, ...]:
        """The steps by the floors of the samples, not by those of what is compared."""
        return tuple(coarse_step(r.log[SIGNAL], self.floors.of(r.log, SIGNAL)) for r in self.runs)

    def shown(self, model: Model, theta: Floats, run: int) -> Floats:
        """Return what the twin shows at the rows of a run, (rows,), NaN where there is none that is compared."""
        data = self.runs[run]
        column, recorded = np.full(len(data.log), np.nan), data.log[SIGNAL]
        for part, read in zip(data.parts, self._read(model, theta, run), strict=True):
            column[part.rows] = np.interp(data.log.t_s[part.rows], part.at_s, read[0])
        return as_read(column, recorded, self.step_of(run))

    def _read(self, model: Model, theta: Floats, run: int) -> list[Floats]:
        """The readings of each part of a run, (lanes, n)."""
        assert self.machine.thermal is not None
        data = self.runs[run]
        values, factors = model.values(theta), model.factors(theta)
        constants: dict[str, ArrayLike] = {}
        for name, value in thermal_constants(self.machine.thermal).items():
            key = CAPACITY if name == "heat_capacity_j_per_k" else name
            constants[name] = value * factors.get(f"thermal.{key}", np.ones(len(theta)))
        constants |= model.effect_constants(theta, self.effects, self.standing)
        sensing = Sensing.of(values, SIGNAL, standing_sensors(self.machine, SIGNAL))
        arguments = self._arguments(data) if self.terms or model.terms else {}
        added = with_quantity_terms(added_series(self.terms, arguments), model, theta, lambda: arguments)
        learned = reading_of_terms(model, theta, SIGNAL, lambda: arguments)
        standing = reading_series(self.terms, SIGNAL, arguments)
        learned = learned if standing is None else learned + standing
        step = self._log_steps[run]
        found, place = [], 0
        for part in data.parts:
            here = slice(place, place + len(part.at_s))
            place = here.stop
            warmth = None if "heat_w" not in added else added["heat_w"][..., here]
            read = self._begun(part, sensing, len(theta), step, self._warmed(model, constants, part, warmth))
            found.append(read + (learned[..., here] if isinstance(learned, np.ndarray) else learned))
        return found

    def _warmed(self, model: Model, constants: dict[str, ArrayLike], part: Stretch, added_w: Floats | None) -> Warmed:
        """The spindle of one part by its temperature at the start, and whether what is beside it is as cold as the air then."""
        named = tuple(e.name for e in self.effects)
        acting = {e.effect for e in model.effects} | set(self.standing)

        def shown(start_c: Floats, *, cold: bool = False) -> Floats:
            beside = np.full(len(start_c), part.ambient_c) if cold else None
            found = spindle_temperature_c(constants, part.warming, start_c, effects=named, added_w=added_w, beside_c=beside)
            return np.broadcast_to(found, (len(start_c), found.shape[1]))

        return Warmed(shown, any(effect.states and effect.name in acting for effect in self.effects))

    def _begun(self, part: Stretch, sensing: Sensing, lanes: int, step: float, warmed: Warmed) -> Floats:
        """The readings of one part, (lanes, n), from the start that its recording tells."""
        late = behind_k(sensing, part.slope_k_per_s, lanes)
        start = sensing.value(np.full(lanes, part.start_c)) + late
        whole = warmed.shown(start)
        read = read_from(sensing, whole, part)
        if warmed.keeps_heat:
            cold = warmed.shown(start, cold=True)
            read = between(read, read_from(sensing, cold, part) - read, part.temperature_c, 0.0)
        unsure, begins = np.maximum(0.5 * step, LATE_PART * np.abs(late)), np.isfinite(part.begun_c)
        if unsure.any() or begins.any():
            warmer = from_rest(sensing, warmed.shown(start + 1.0) - whole, part)
            if begins.any():  # a line says little of a spindle that begins to turn meanwhile
                bent_k = BENT_PART * float(np.std(part.begun_c[begins]))
                read = between(read, bent_k * warmer, part.begun_c, -1.0)
            if unsure.any():
                read = between(read, unsure[:, None] * warmer, part.temperature_c, -1.0)
        return read


def heat_runs(machine: MachineFile, runs: tuple[Run, ...]) -> tuple[HeatRun, ...]:
    """The runs in which the spindle's temperature is recorded beside all that drives it."""
    if machine.thermal is None:
        return ()
    there = [(run, stretches_of(run.log)) for run in runs if run.log.has(*NEEDS)]
    return tuple(HeatRun(run.name, run.log, parts, run.entry.role == "fit") for run, parts in there if parts)
