"""The cut and the spindle's load: forces on the dynamometer and what the meter shows, from the recorded engagement on."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.case import Run
from twin.effects.added import added_effects
from twin.effects.catalogue import catalogue, effect_named
from twin.effects.effect import Effect, Guesses, On, Recorded
from twin.gap.diagnosis import Effected
from twin.gap.floors import Floors
from twin.gap.labels import regime_labels
from twin.gap.stages.free import Free, constant
from twin.gap.stages.machine_terms import reading_of_terms, with_force_terms, with_quantity_terms
from twin.gap.stages.observed_through import Sensing, sensor_effects
from twin.gap.stages.stage import Model, Observed, observed_of
from twin.identification.batch_fit import time_blocks
from twin.learned.arguments import around, other_axes
from twin.learned.cutting import cut_arguments, cut_series, milling_with_terms
from twin.learned.standing import added_series, reading_series, terms_at
from twin.learned.term import Term
from twin.learned.words import LearnedSite
from twin.machine import MachineFile, Tool
from twin.process.jump import at_a_jump
from twin.process.kernel import process_quantities
from twin.process.milling import Milling, MillingForce, tool_constants
from twin.runlog import RunLog
from twin.simulator.recorded import told_of
from twin.simulator.response import milling_of
from twin.spindle.load import spindle_constants, spindle_load_pct, spindle_quantities

Floats = NDArray[np.float64]
BLOCK_S = 0.25
FORCES = ("force_x_n", "force_y_n")
LOAD = "spindle_load_pct"
MATERIAL = ("tangential_coefficient_n_per_mm2", "radial_ratio")
TERM_PART, TERM_FLOORS = 0.05, 3.0


@dataclass(frozen=True, slots=True, eq=False)
class CutRun:
    """A run that cuts, or at least turns the spindle under its load meter."""

    name: str
    log: RunLog
    milling: Milling | None
    fitted: bool


def tool_path(tool: str, name: str) -> str:
    """Return the path in machine.toml of a constant of a tool, by its number; of the only tool where that is empty."""
    return f"tools.{tool}.{name}" if tool else f"tool.{name}"


def factored_tool(tool: Tool, number: str, factors: Mapping[str, Floats], lanes: int) -> dict[str, ArrayLike]:
    """Return the constants of a tool in each lane, name → (lanes,), with the factors of a hypothesis on them, by path."""
    one = np.ones(lanes)
    return {name: value * factors.get(tool_path(number, name), one) for name, value in tool_constants(tool).items()}


def acting(known: Mapping[str, str]) -> tuple[Effect, ...]:
    """Effects on the machine that change one of these quantities."""
    return tuple(e for e in catalogue().values() if e.on is On.MACHINE and set(e.changes) & set(known))


@dataclass(frozen=True, eq=False)
class CutStage:
    """Process force and spindle of a case."""

    machine: MachineFile
    runs: tuple[CutRun, ...]
    floors: Floors
    left_out: frozenset[str] = frozenset()
    tool: str = ""
    name: str = "cut and spindle"
    averaged: int = 1
    healthy_rms: float = 1.3
    observed: tuple[Observed, ...] = field(init=False)
    _arguments_told: dict[str, Mapping[str, Floats]] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "observed", tuple(self._observed(run) for run in self.runs))

    @cached_property
    def standing(self) -> dict[str, Mapping[str, float]]:
        """Effects that the machine has already."""
        return added_effects(self.machine, {*process_quantities(), *spindle_quantities()})

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Learned terms that the machine has already."""
        return terms_at(self.machine.learned, (LearnedSite.CUT_FORCE, LearnedSite.SPINDLE_POWER, LearnedSite.FORCE_READING))

    @property
    def constants(self) -> tuple[Free, ...]:
        """K_t and K_e where something is cut, efficiency and idle power where a load is shown."""
        stated = self.machine.uncertainty
        relative = stated.get("relative", 0.05)
        cuts = self.machine.tool is not None and any(run.milling for run in self.runs)
        names = [tool_path(self.tool, name) for name in MATERIAL] if cuts else []
        if self.machine.spindle is not None and any(LOAD in o.signals for o in self.observed):
            names += ["spindle.efficiency"] if cuts else []
            names += ["spindle.idle_power_kw"] if self.machine.spindle.idle_power_kw > 0.0 else []
        sigma = [stated.get(name.replace(f"tools.{self.tool}.", "tool."), relative) for name in names]
        free = [constant(name, one) for name, one in zip(names, sigma, strict=True)]
        return tuple(p for p in free if p.sigma > 0.0)

    @property
    def candidates(self) -> tuple[Effected, ...]:
        """Effects that forces and load can show."""
        signals = {s for o in self.observed for s in o.signals}
        there = self.left_out | set(self.standing)
        here = [Effected(e.name, self.tool) for e in acting(process_quantities())]
        here += [Effected(e.name) for e in acting(spindle_quantities())]
        found = [e for e in here if e.effect not in there and set(effect_named(e.effect).shows_in) & signals]
        return tuple(dict.fromkeys((*found, *sensor_effects(signals, self.left_out))))

    def first_guesses(self, candidate: Effected) -> Guesses:
        """Return the effect's own guesses."""
        return effect_named(candidate.effect).first_guesses(Recorded(self.machine.machine.servo_period_s))

    def _observed(self, run: CutRun) -> Observed:
        log, parts = run.log, []
        blocks = time_blocks(log.t_s, BLOCK_S)
        for signal in (*FORCES, LOAD):
            if not log.has(signal) or (signal in FORCES and run.milling is None):
                continue
            if signal == LOAD and self.machine.spindle is None:
                continue
            measured = log[signal].copy()
            if signal in FORCES and run.milling is not None:
                measured[~self._compared(run.milling)] = np.nan
            floor = self.floors.of(log, signal)
            parts.append((signal, measured, floor, floor, blocks, regime_labels(log, signal, self.machine)[1]))
        return observed_of(run.name, parts, run.fitted)

    def _compared(self, milling: Milling) -> NDArray[np.bool_]:
        """Return True where the tool cuts, but no tooth enters or leaves just then: who is a hair early decides there."""
        assert self.machine.tool is not None
        cutting = np.nan_to_num(milling.axial_depth_mm) > 0.0
        return np.asarray(cutting & ~at_a_jump(milling, self.machine.tool.teeth, 2e-4)[0])

    def predict(self, model: Model, theta: Floats, run: int) -> Floats:
        """Forces and load at each row of θ, (lanes, n)."""
        data = self.runs[run]
        lanes, ticks = len(theta), len(data.log)
        values = model.values(theta)
        force = self.force(model, theta, data)
        power_w = np.zeros((lanes, ticks)) if force is None else np.broadcast_to(force.cutting_power_w(), (lanes, ticks))
        shown = []
        period_s = self.machine.machine.servo_period_s
        for signal in self.observed[run].signals:
            if signal == LOAD:
                values_of = self._load(model, theta, power_w, data, period_s)
            else:
                assert force is not None
                values_of = np.broadcast_to(force.force_x_n if signal == "force_x_n" else force.force_y_n, (lanes, ticks))
            learned = reading_series(self.terms, signal, self._arguments(data)) if self.terms else None
            fitted = reading_of_terms(model, theta, signal, lambda: self._told(data))
            read = Sensing.of(values, signal).readings(values_of, period_s) + fitted
            shown.append(read if learned is None else read + learned)
        return np.concatenate(shown, axis=1)

    def _arguments(self, data: CutRun) -> dict[str, Floats]:
        """The arguments of learned terms in a run, by its recording."""
        log = data.log
        references = {a: log[f"{a}_ref_mm"] for a in log.axes() if log.has(f"{a}_ref_mm")}
        known = around(log.t_s, log.columns) | other_axes(log.t_s, references)
        tool = self.machine.tool
        return known | (cut_arguments(data.milling, tool.teeth) if data.milling is not None and tool is not None else {})

    def _told(self, data: CutRun) -> Mapping[str, Floats]:
        """The same with the load that the machine as stated shows: the recorded one has in it what is looked for."""
        if data.name not in self._arguments_told:
            told = self._arguments(data)
            if LOAD in self.observed[0].signals and data.log.has("spindle_rpm"):
                bare, theta = Model((), ()), np.zeros((1, 0))
                force = self.force(bare, theta, data)
                power_w = np.zeros((1, len(data.log))) if force is None else force.cutting_power_w()
                told["load_pct"] = self._load(bare, theta, power_w, data, self.machine.machine.servo_period_s)[0]
            self._arguments_told[data.name] = told
        return self._arguments_told[data.name]

    @property
    def term_sites(self) -> Mapping[LearnedSite, tuple[str, ...]]:
        """The sites of learned terms that forces and load show."""
        signals = {s for o in self.observed for s in o.signals}
        forces = tuple(signal for signal in FORCES if signal in signals)
        of_forces = {LearnedSite.CUT_FORCE: ("",), LearnedSite.FORCE_READING: forces} if forces else {}
        return of_forces | ({LearnedSite.SPINDLE_POWER: ("",)} if LOAD in signals else {})

    def term_sizes(self, site: LearnedSite, on: str) -> float:
        """Return the size of a small term: a part of K_t or of the rated power, or a few floors of what is read."""
        if site is LearnedSite.CUT_FORCE:
            assert self.machine.tool is not None
            return TERM_PART * self.machine.tool.tangential_coefficient_n_per_mm2
        if site is LearnedSite.SPINDLE_POWER:
            assert self.machine.spindle is not None
            return TERM_PART * max(self.machine.spindle.idle_power_kw, TERM_PART * self.machine.spindle.rated_power_kw)
        return TERM_FLOORS * float(np.nanmedian(self.floors.of(self.runs[0].log, on)))

    def term_arguments(self, run: int) -> Mapping[str, Floats]:
        """Return what a term may depend on in a run, where it cuts if there is a cut."""
        told = self._told(self.runs[run])
        cutting = told.get("axial_depth_mm", np.ones(len(self.runs[run].log))) > 0.0
        return {name: values[cutting] if name != "load_pct" else values for name, values in told.items()}

    def force(self, model: Model, theta: Floats, data: CutRun) -> MillingForce | None:
        """The cutting force at each row of θ; None where nothing is cut."""
        if data.milling is None or self.machine.tool is None:
            return None
        constants = factored_tool(self.machine.tool, self.tool, model.factors(theta), len(theta))
        effects = acting(process_quantities())
        constants |= model.effect_constants(theta, effects, self.standing)
        known = cut_series(self.terms, self._arguments(data)) if self.terms else {}
        series = with_force_terms(known, model, theta, lambda: self._told(data))
        return milling_with_terms(
            constants,
            self.machine.tool.teeth,
            data.milling,
            series,
            period_s=self.machine.machine.servo_period_s,
            effects=tuple(e.name for e in effects),
        )

    def _load(self, model: Model, theta: Floats, power_w: Floats, data: CutRun, period_s: float) -> Floats:
        assert self.machine.spindle is not None
        factors = model.factors(theta)
        one = np.ones(len(theta))
        constants: dict[str, ArrayLike] = {
            name: value * factors.get(f"spindle.{name}", one) for name, value in spindle_constants(self.machine.spindle).items()
        }
        effects = acting(spindle_quantities())
        constants |= model.effect_constants(theta, effects, self.standing)
        named = tuple(e.name for e in effects)

        def load(added_kw: Floats | None) -> Floats:
            rpm = data.log["spindle_rpm"]
            return spindle_load_pct(constants, power_w, rpm, period_s=period_s, effects=named, added_kw=added_kw)

        known = added_series(self.terms, self._arguments(data) | {"load_pct": load(None)[0]}) if self.terms else {}
        return load(with_quantity_terms(known, model, theta, lambda: self._told(data)).get("electrical_power_kw"))


def cut_runs(machine: MachineFile, runs: tuple[Run, ...]) -> tuple[CutRun, ...]:
    """The runs in which forces or the spindle's load are recorded at the servo period, over an engagement that is known."""
    found = []
    for run in runs:
        log = run.log
        if not log.axes() or not (log.has(LOAD, "spindle_rpm") or log.has("force_x_n") or log.has("force_y_n")):
            continue
        milling = milling_of(told_of(log, machine)) if machine.tool else None
        if milling is None and not log.has(LOAD, "spindle_rpm"):
            continue
        found.append(CutRun(run.name, log, milling, run.entry.role == "fit"))
    return tuple(found)
