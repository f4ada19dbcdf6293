"""An axis: its loops and mechanics from the reference on, beside the recorded position, table and torque.

The axis is simulated stretch by stretch (`twin.regimes.motion_stretches`), each from the torque that was measured before it, as
the mean over a few courses of the disturbance that the machine has. What the table does is compared against the motor's position,
so that where the axis came to rest is not counted twice.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache, reduce

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import catalogue, effect_named
from twin.effects.effect import Effect, Guesses, On, Recorded, called
from twin.gap.diagnosis import Effected
from twin.gap.stages.axis_run import OUTPUTS, AxisRunData
from twin.gap.stages.axis_terms import readings_of_terms, series_of_terms, sites_of_terms, size_of_terms, start_of_terms
from twin.gap.stages.free import Free, constant
from twin.gap.stages.observed_through import Sensing, Values, seen_late
from twin.gap.stages.stage import Model, Observed, observed_of
from twin.identification.axis_parameters import AxisParameter, constants_at
from twin.identification.batch_fit import time_blocks
from twin.learned.term import Term
from twin.learned.words import LearnedSite
from twin.machine import Axis, MachineFile
from twin.servo.constants import axis_constants, effect_constants
from twin.servo.disturbance import Disturbance
from twin.servo.kernel import axis_quantities
from twin.servo.run import AxisInput, AxisRun, run_axes
from twin.simulator.recorded import start_state
from twin.sites import Site

Floats = NDArray[np.float64]
BLOCK_S = 0.5
COURSES = 2
"""Pairs of courses, each with its opposite."""
LANES, FEW = 32, 4
"""Widths of the kernels that are used: of many candidates, and of one or two alone."""
TICKS_TOGETHER = 4
FACTORS = ("mass_kg", "newton_per_command", "coulomb_n", "static_n", "stribeck_velocity_mm_s", "viscous_n_s_per_mm")


@cache
def axis_effects() -> tuple[Effect, ...]:
    """The effects that are woven into the loops and mechanics of an axis."""
    return tuple(e for e in catalogue().values() if e.on is On.AXIS and set(e.changes) & set(axis_quantities()))


@dataclass(frozen=True, slots=True, eq=False)
class AxisStage:
    """One axis of a case."""

    letter: str
    axis: Axis
    period_s: float
    runs: tuple[AxisRunData, ...]
    constants: tuple[Free, ...]
    disturbance: Disturbance | None
    left_out: frozenset[str] = frozenset()
    standing: tuple[tuple[str, Mapping[str, float]], ...] = ()
    pairs: int = COURSES
    terms: tuple[Term, ...] = ()
    observed: tuple[Observed, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "observed", tuple(self._observed(run) for run in self.runs))

    @property
    def name(self) -> str:
        """Name in reports."""
        return f"axis {self.letter}"

    @property
    def healthy_rms(self) -> float:
        """Higher where a cut pushes the axis, since single teeth decide where it creeps to a stop and the twin has their mean,
        and where position or torque was not recorded, since its start is not known then."""
        blind = not {"pos_mm", "torque_a"} <= set(self.outputs)
        return 2.0 if blind or any(run.disturbance_n is not None and run.disturbance_n.any() for run in self.runs) else 1.3

    @property
    def averaged(self) -> int:
        """Return the samples of 4 ticks: a loop does little in so short a time."""
        known = [np.flatnonzero(np.isfinite(o.measured)) for o in self.observed if o.fitted]
        every = np.median(np.concatenate([np.diff(k) for k in known] or [np.ones(1)]))
        return max(1, round(TICKS_TOGETHER / float(every))) if np.isfinite(every) else 1

    @property
    def outputs(self) -> tuple[str, ...]:
        """Columns of the run log that are compared, without the letter."""
        return tuple(name for name in OUTPUTS if name in self.runs[0].measured)

    @property
    def carried_states(self) -> frozenset[str]:
        """States of effects that outlast a rest."""
        return frozenset(f"{effect.name}__{state}" for effect in axis_effects() for state in effect.carried)

    @property
    def stateable(self) -> tuple[Effected, ...]:
        """Effects on the axis itself of which machine and recordings say all that they need."""
        warm = all(run.rise_k is not None for run in self.runs)
        there = self.left_out | {name for name, _ in self.standing}
        unknown = set() if warm else {"temperature_rise_k"}
        unknown |= set() if self.axis.screw_lead_mm is not None else {"screw_lead_mm"}
        of_axis = (e for e in catalogue().values() if e.on is On.AXIS and e.name not in there)
        return tuple(Effected(e.name, self.letter) for e in of_axis if not unknown & set(e.needs))

    @property
    def candidates(self) -> tuple[Effected, ...]:
        """Effects of the axis that its signals can show, sensors and clock included."""
        found = []
        stateable = set(self.stateable)
        for effect in catalogue().values():
            if effect.name in self.left_out or any(effect.name == name for name, _ in self.standing):
                continue
            if Effected(effect.name, self.letter) in stateable:
                shown = any(s.replace("{a}", self.letter) == f"{self.letter}_{o}" for s in effect.shows_in for o in self.outputs)
                found += [Effected(effect.name, self.letter)] if shown else []
            elif effect.on is On.SIGNAL:
                found += [Effected(effect.name, f"{self.letter}_{output}") for output in self.outputs]
            elif effect.site is Site.CLOCK:
                found.append(Effected(effect.name))
        return tuple(found)

    @property
    def term_sites(self) -> Mapping[LearnedSite, tuple[str, ...]]:
        """The sites of learned terms that the outputs show."""
        return sites_of_terms(self.letter, self.outputs)

    def term_sizes(self, site: LearnedSite, on: str) -> float:
        """Return the size of a small term: a tenth of the friction, a few floors of a reading."""
        del on
        return size_of_terms(site, self.axis, self.runs[0])

    def term_arguments(self, run: int) -> Mapping[str, Floats]:
        """Return what a term may depend on in a run, over its stretches."""
        where = np.concatenate([np.arange(len(self.runs[run].t_s))[s] for s in self.runs[run].stretches()])
        return {column: values[where] for column, values in self.runs[run].arguments.items()}

    def first_guesses(self, candidate: Effected) -> Guesses:
        """Return the effect's own guesses."""
        output = candidate.on.removeprefix(f"{self.letter}_")
        recorded = Recorded(self.period_s, self._peak, lambda: self._over_modelled(output))
        return effect_named(candidate.effect).first_guesses(recorded)

    def _peak(self, output: str) -> float:
        """The largest magnitude of an output in the runs that are fitted; 0 where it is not recorded."""
        if output not in self.outputs:
            return 0.0
        return max(float(np.nanmax(np.abs(run.measured[output]))) for run in self.runs if run.fitted)

    def _over_modelled(self, output: str) -> float:
        """An output as recorded over as the machine as stated shows it, started without its sensor; NaN where it does not say."""
        data = next(run for run in self.runs if run.fitted)
        blind = replace(data, measured={k: v for k, v in data.measured.items() if k not in (output, "pos_mm", "table_mm")})
        shown = self.simulate(Model((), ()), np.zeros((1, 0)), blind)[output][0]
        recorded = np.concatenate([data.measured[output][s] for s in data.stretches()])
        known = np.isfinite(recorded) & np.isfinite(shown)
        does, is_read = (v[known] - np.median(v[known]) for v in (shown, recorded))
        energy = float(does @ does)
        return float(does @ is_read) / energy if known.any() and energy > 0.0 else float("nan")

    def _observed(self, run: AxisRunData) -> Observed:
        parts = []
        where = np.concatenate([np.arange(len(run.t_s))[s] for s in run.stretches()] or [np.array([], dtype=np.intp)])
        blocks = time_blocks(run.t_s, BLOCK_S)[where]
        for output in self.outputs:
            measured, floor = run.measured[output], run.floor[output]
            if output == "table_mm" and "pos_mm" in run.measured:
                measured = measured - run.measured["pos_mm"]
                noise = np.sqrt(np.min(floor) ** 2 + np.min(run.floor["pos_mm"]) ** 2)
                floor = np.full(len(floor), noise)
            known = run.of_loops(measured)[where]
            sigma = floor[where] / np.sqrt(run.count)
            parts.append((f"{self.letter}_{output}", known, floor[where], sigma, blocks, run.regime[where]))
        return observed_of(run.name, parts, run.fitted)

    def predict(self, model: Model, theta: Floats, run: int) -> Floats:
        """Return the outputs of the axis at each row of θ, (lanes, n)."""
        data = self.runs[run]
        outputs = self.simulate(model, theta, data)
        values = model.values(theta)
        shown = []
        starts = np.cumsum([0, *(stretch.stop - stretch.start for stretch in data.stretches())])[:-1].tolist()
        for output in self.outputs:
            sensing = Sensing.of(values, f"{self.letter}_{output}")
            modelled = sensing.readings(outputs[output], self.period_s, starts)
            modelled = modelled + readings_of_terms(model, theta, f"{self.letter}_{output}", data, self.terms)
            shown.append(self.grown(modelled, values, data) if output == "table_mm" else modelled)
        at = {output: i for i, output in enumerate(self.outputs)}
        if "table_mm" in at and "pos_mm" in at:
            shown[at["table_mm"]] = shown[at["table_mm"]] - shown[at["pos_mm"]]
        return np.concatenate(shown, axis=1)

    def grown(self, table_mm: Floats, values: Values, data: AxisRunData) -> Floats:
        """Return the table, (lanes, n), as the effects of the model make it grow with the recorded temperature."""
        for effected, given in values.items():
            reading = effect_named(effected.effect).changes.get("reading")
            if reading is None or effected.on != self.letter or data.rise_k is None:
                continue
            rise_k = np.concatenate([data.rise_k[stretch] for stretch in data.stretches()])
            known = {name: np.atleast_1d(value)[:, None] for name, value in given.items()} | {"temperature_rise_k": rise_k}
            table_mm = np.asarray(called(reading, known, table_mm))
        return table_mm

    def simulate(self, model: Model, theta: Floats, data: AxisRunData) -> dict[str, Floats]:
        """The outputs over the stretches one after another, each (lanes, n): before sensors, on the recording's clock."""
        lanes = len(theta)
        values = model.values(theta)
        constants = self.lane_constants(model, theta)
        courses = self._courses(len(data.t_s))
        parts: dict[str, list[Floats]] = {output: [] for output in self.outputs}
        carried: dict[str, Floats] = {}
        kept = set(self.carried_states)
        if "torque_a" not in data.measured:  # an integral that was not measured goes on as the twin left it
            kept.add("integral_a")
        for stretch in data.stretches():
            learned = start_of_terms(model, theta, self.letter, data.arguments, stretch.start, self.terms)
            start = self._start(values, constants, data, stretch, lanes, learned) | carried
            reference = self.seen_reference(values, data, stretch, lanes)
            added = series_of_terms(model, theta, self.letter, data.arguments, stretch, self.terms)
            run, many = self._run(constants, reference, data, courses, stretch, start, added)
            for output in self.outputs:
                whole = run.outputs[OUTPUTS[output]]
                mean = whole.reshape(-1, many, whole.shape[1]).mean(axis=1)[:lanes]
                parts[output].append(_stamped(mean, data.t_s[stretch], values))
            carried = {k: v.reshape(-1, many)[:lanes, 0] for k, v in run.state.items() if k in kept}
        return {output: np.concatenate(p, axis=1) for output, p in parts.items()}

    def seen_reference(self, values: Values, data: AxisRunData, stretch: slice, lanes: int) -> Floats:
        """The reference that the loop sees: (n,), or (lanes, n) where it sees it late."""
        period_s = float(data.t_s[1] - data.t_s[0])
        return seen_late(data.reference_mm[stretch], data.t_s[stretch], period_s, values, Site.REFERENCE, self.letter, lanes)

    def _run(
        self,
        constants: Mapping[str, Floats],
        reference: Floats,
        data: AxisRunData,
        courses: Floats,
        stretch: slice,
        start: Mapping[str, Floats],
        added: Mapping[str, Floats],
    ) -> tuple[AxisRun, int]:
        """Run the lanes over one stretch, each over all courses; added: quantity → (lanes, ticks), put on top of it."""
        lanes = len(next(iter(constants.values())))
        many = len(courses)
        ticks = len(data.t_s[stretch])
        fill = filled(lanes * many)
        index = np.minimum(np.arange(fill) // many, lanes - 1)
        known = np.zeros(ticks) if data.disturbance_n is None else data.disturbance_n[stretch]
        force = known[None, :] + courses[:, stretch]
        columns = np.atleast_2d(reference)
        if len(columns) > 1 or added:  # each lane sees a reference of its own, or is pushed by a term of its own
            columns = _each(columns, many) if len(columns) > 1 else columns
            force = np.tile(force, (lanes, 1)) if many > 1 else force
            column = np.minimum(np.arange(fill), lanes * many - 1)
        else:
            column = np.arange(fill) % many
        run = run_axes(
            {name: value[index] for name, value in constants.items()},
            AxisInput(columns, column, force, added={name: _each(values, many) for name, values in added.items()}),
            period_s=self.period_s,
            effects=tuple(e.name for e in axis_effects()),
            outputs=("position_mm", "torque_a", "table_mm"),
            start={name: np.broadcast_to(value, (lanes,))[index] for name, value in start.items()},
            first_tick=stretch.start,
        )
        return run, many

    def lane_constants(self, model: Model, theta: Floats) -> dict[str, Floats]:
        """Return the constants of the axis and of its effects at each row of θ, name → (lanes,)."""
        base = axis_constants(self.axis)
        parameters = tuple(AxisParameter(p.name, "", True, p.sigma) for p in model.constants)
        constants = constants_at(base, parameters, theta[:, : len(parameters)])
        if self.axis.screw_lead_mm is None:  # woven in all the same, and times nothing
            constants["screw_lead_mm"] = np.ones(len(theta))
        given: dict[str, Floats] = {}
        for effect in axis_effects():
            for key, value in effect.null_values().items():
                given[f"{effect.name}__{key}"] = np.full(len(theta), value)
        for name, standing in self.standing:
            for key, value in effect_constants(effect_named(name), standing, base, self.letter).items():
                given[key] = np.full(len(theta), value)
        for effected, values in model.values(theta).items():
            for key, array in values.items():
                if f"{effected.effect}__{key}" in given:
                    given[f"{effected.effect}__{key}"] = array
        return constants | given

    def _start(
        self,
        values: Values,
        constants: Mapping[str, Floats],
        data: AxisRunData,
        where: slice,
        lanes: int,
        learned: Mapping[str, Floats],
    ) -> dict[str, Floats]:
        """The state at the first sample of a stretch, as the sensors of each lane would have it.

        learned: what learned terms add there to a force or a reading
        """
        reference = data.reference_mm[where]
        position = data.measured.get("pos_mm", data.measured.get("table_mm", data.reference_mm))[where]
        torque = data.measured["torque_a"][where] if "torque_a" in data.measured else np.zeros(len(reference))
        read = start_state(self.axis, reference, position, torque, self.period_s)
        loops = self._start_of_loops(values, read, float(reference[0]), lanes, learned)
        state = {k: np.full(lanes, v) for k, v in read.items()} | loops
        load = at_rest("load_n", constants, {}, lanes) - learned.get("external_force_n", 0.0)
        if "torque_a" not in data.measured and self.axis.velocity_integral_gain_a_per_mm > 0.0:
            state["integral_a"] = load / constants["newton_per_command"]
        held = constants["newton_per_command"] * state["integral_a"] - load
        static = np.where(held > 0.0, constants["static_plus_n"], constants["static_minus_n"])
        held = np.clip(held, -static, static)
        state["bristle_mm"] = at_rest("bristle_mm", constants, {"held_n": held}, lanes)
        return state

    def _start_of_loops(
        self, values: Values, read: Mapping[str, float], reference_mm: float, lanes: int, learned: Mapping[str, Floats]
    ) -> dict[str, Floats]:
        """Position and integrals of the loops whose position and torque the sensors of each lane read as `read`."""
        position = Sensing.of(values, f"{self.letter}_pos_mm").value(read["position_mm"] - learned.get("pos_mm", np.zeros(lanes)))
        integral = np.full(lanes, read["integral_a"])
        if self.axis.velocity_integral_gain_a_per_mm > 0.0:
            gain = self.axis.velocity_gain_a_s_per_mm + self.axis.velocity_integral_gain_a_per_mm * self.period_s
            part = gain * self.axis.position_gain_per_s  # of the torque that the position loop asks for
            torque = integral + part * (reference_mm - read["position_mm"]) - learned.get("torque_a", 0.0)
            integral = Sensing.of(values, f"{self.letter}_torque_a").value(torque) - part * (reference_mm - position)
        return {"position_mm": position, "integral_a": integral}

    def _courses(self, ticks: int) -> Floats:
        if self.disturbance is None:
            return np.zeros((1, ticks))
        half = self.disturbance.courses(self.pairs, ticks, self.period_s, seed=[11, ord(self.letter[0])])
        return np.concatenate([half, -half])


def _each(values: Floats, many: int) -> Floats:
    """Return each lane `many` times, one after another; without a copy where all lanes are alike."""
    if values.strides[0] == 0:
        return np.broadcast_to(values[0], (len(values) * many, values.shape[1]))
    return np.repeat(values, many, axis=0) if many > 1 else values


def filled(lanes: int) -> int:
    """Return the lanes that so many are filled up to, so that they fit kernels of few widths.

    >>> [filled(lanes) for lanes in (1, 4, 5, 32, 36, 40)]
    [4, 4, 32, 32, 36, 64]
    """
    rest = lanes % LANES
    return lanes - rest + (0 if not rest else FEW if rest <= FEW else LANES)


def _stamped(shown: Floats, t_s: Floats, values: Values) -> Floats:
    """The outputs, (lanes, n), as the clock of the feedback stamps them."""
    if len(t_s) < 2:
        return shown
    return seen_late(shown, t_s, float(t_s[1] - t_s[0]), values, Site.CLOCK, "", len(shown))


def at_rest(start: str, constants: Mapping[str, Floats], known: Mapping[str, Floats], lanes: int) -> Floats:
    """The start of a stretch as the effects of the axis make it together, (lanes,)."""
    parts = []
    for effect in axis_effects():
        if function := effect.at_rest.get(start):
            own = {p.name: constants[f"{effect.name}__{p.name}"] for p in effect.parameters}
            parts.append(np.asarray(called(function, {**known, **own})))
    return reduce(np.add, parts) if parts else np.zeros(lanes)


def standing_of(machine: MachineFile, letter: str) -> tuple[tuple[str, Mapping[str, float]], ...]:
    """The effects that the loops and mechanics of an axis of the machine have already."""
    woven = {e.name for e in axis_effects()}
    return tuple((e.effect, e.parameters) for e in machine.effects if e.on == letter and e.effect in woven)


def axis_constants_free(machine: MachineFile, letter: str) -> tuple[Free, ...]:
    """The constants of an axis that are uncertain, with their priors from `[uncertainty]`."""
    stated = machine.uncertainty
    axis = machine.axes[letter]
    free = []
    for name in FACTORS:
        sigma = stated.get(axis_constant_path(machine, letter, name), stated.get("relative", 0.05))
        zero = name == "viscous_n_s_per_mm" and not np.any(axis.friction.viscous_n_s_per_mm)
        free += [constant(name, sigma)] if sigma > 0.0 and not zero else []
    return tuple(free)


def axis_constant_path(machine: MachineFile, letter: str, name: str) -> str:
    """The path in machine.toml of a free constant of an axis; what a unit of the command pushes with has one of two names."""
    stated_as_force = machine.axes[letter].force_per_command_n is not None
    newton = "force_per_command_n" if stated_as_force else "torque_constant_nm_per_a"
    keys = {"mass_kg": "mass_kg", "newton_per_command": newton}
    return f"axes.{letter}.{keys.get(name, f'friction.{name}')}"
