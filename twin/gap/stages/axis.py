"""An axis: its loops and mechanics from the reference on, beside the recorded position, table and torque.

The axis is simulated stretch by stretch (`twin.regimes.motion_stretches`), each from the torque that was measured before it, as
the mean over a few courses of the disturbance that the machine has. What the table does is compared against the motor's position,
so that where the axis came to rest is not counted twice.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import catalogue, effect_named
from twin.effects.effect import Effect, On
from twin.gap.diagnosis import Effected
from twin.gap.stages.axis_run import OUTPUTS, AxisRunData
from twin.gap.stages.free import Free, constant
from twin.gap.stages.observed_through import Sensing, lags_to_try, seen_earlier
from twin.gap.stages.stage import Model, Observed, observed_of
from twin.identification.axis_parameters import AxisParameter, constants_at
from twin.identification.batch_fit import time_blocks
from twin.machine import Axis, MachineFile
from twin.servo.constants import axis_constants, effect_constants
from twin.servo.disturbance import Disturbance
from twin.servo.kernel import axis_quantities
from twin.servo.run import AxisInput, AxisRun, run_axes
from twin.simulator.recorded import start_state

Floats = NDArray[np.float64]
BLOCK_S = 0.5
COURSES = 2
"""Pairs of courses, each with its opposite."""
LANES = 32
UNIT, UNIT_MAX = 1.5, 5e3
"""Factors from which, and to which, a sensor may be in another unit: the search starts there then."""
FACTORS = ("mass_kg", "newton_per_command", "coulomb_n", "static_n", "stribeck_velocity_mm_s", "viscous_n_s_per_mm")


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
    observed: tuple[Observed, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "observed", tuple(self._observed(run) for run in self.runs))

    @property
    def name(self) -> str:
        """What to call it."""
        return f"axis {self.letter}"

    @property
    def healthy_rms(self) -> float:
        """Where a cut pushes it, single teeth decide where it creeps to a stop, and the twin has their mean only; where position
        or torque was not recorded, how it starts from there is not known."""
        blind = not {"pos_mm", "torque_a"} <= set(self.outputs)
        return 2.0 if blind or any(run.disturbance_n is not None and run.disturbance_n.any() for run in self.runs) else 1.3

    @property
    def averaged(self) -> int:
        """A loop does little within 4 ms."""
        return 4

    @property
    def outputs(self) -> tuple[str, ...]:
        """Columns of the run log that are compared, without the letter."""
        return tuple(name for name in OUTPUTS if name in self.runs[0].measured)

    @property
    def candidates(self) -> tuple[Effected, ...]:
        """Effects of the axis that its signals can show, sensors and clock included."""
        found = []
        for effect in catalogue().values():
            if effect.name in self.left_out or any(effect.name == name for name, _ in self.standing):
                continue
            warm = all(run.rise_k is not None for run in self.runs)
            if effect.on is On.AXIS and ("temperature_rise_k" not in effect.needs or warm):
                shown = any(s.replace("{a}", self.letter) == f"{self.letter}_{o}" for s in effect.shows_in for o in self.outputs)
                known = "screw_lead_mm" not in effect.needs or self.axis.screw_lead_mm is not None
                found += [Effected(effect.name, self.letter)] if shown and known else []
            elif effect.on is On.SIGNAL:
                found += [Effected(effect.name, f"{self.letter}_{output}") for output in self.outputs]
            elif effect.name == "clock_drift":
                found.append(Effected(effect.name))
        return tuple(found)

    def first_guesses(self, candidate: Effected) -> tuple[dict[str, float], ...]:
        """A limit shows as the largest torque there was."""
        if candidate.effect == "torque_limit" and "torque_a" in self.outputs:
            largest = max(float(np.nanmax(np.abs(run.measured["torque_a"]))) for run in self.runs if run.fitted)
            return tuple({"limit_a": f * largest} for f in (1.0, 0.97, 0.9)) if largest > 0.0 else ()
        if candidate.effect == "sensor_lag":
            return lags_to_try(self.period_s)
        if candidate.effect == "sensor_scale":
            scale = self._scale(candidate.on.removeprefix(f"{self.letter}_"))
            return ({"scale": scale},) if abs(scale) < UNIT_MAX and not 1.0 / UNIT < scale < UNIT else ()
        return ()

    def _scale(self, output: str) -> float:
        """What is recorded over what the machine as stated would show, started without the sensor; NaN where it does not say."""
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
            known = measured[where]
            sigma = floor[where] / np.sqrt(run.count)
            parts.append((f"{self.letter}_{output}", known, floor[where], sigma, blocks, run.regime[where]))
        return observed_of(run.name, parts, run.fitted)

    def predict(self, model: Model, theta: Floats, run: int) -> Floats:
        """What the axis shows at each row of θ, (lanes, n)."""
        data = self.runs[run]
        outputs = self.simulate(model, theta, data)
        values = model.values(theta)
        shown = []
        for output in self.outputs:
            sensing = Sensing.of(values, f"{self.letter}_{output}")
            modelled = sensing.readings(outputs[output], self.period_s)
            shown.append(modelled + self._growth(values, data) if output == "table_mm" else modelled)
        at = {output: i for i, output in enumerate(self.outputs)}
        if "table_mm" in at and "pos_mm" in at:
            shown[at["table_mm"]] = shown[at["table_mm"]] - shown[at["pos_mm"]]
        return np.concatenate(shown, axis=1)

    def _growth(self, values: Mapping[Effected, Mapping[str, Floats]], data: AxisRunData) -> Floats:
        """What the table grows by with the recorded temperature at each row of θ, (lanes, n); 0 where the model has it not."""
        grown = values.get(Effected("thermal_growth", self.letter))
        if grown is None or data.rise_k is None:
            return np.zeros((1, 1))
        rise_k = np.concatenate([data.rise_k[stretch] for stretch in data.stretches()])
        return np.asarray(0.001 * np.atleast_1d(grown["um_per_k"])[:, None] * rise_k[None, :])

    def simulate(self, model: Model, theta: Floats, data: AxisRunData) -> dict[str, Floats]:
        """The outputs over the stretches one after another, each (lanes, n): before sensors, on the recording's clock."""
        lanes = len(theta)
        values = model.values(theta)
        constants = self._constants(model, theta)
        courses = self._courses(len(data.t_s))
        parts: dict[str, list[Floats]] = {output: [] for output in self.outputs}
        carried: dict[str, Floats] = {}
        own = () if "torque_a" in data.measured else ("integral_a",)  # what nobody has measured goes on as the twin left it
        for stretch in data.stretches():
            start = self._start(values, constants, data, stretch, lanes) | carried
            reference = _late(data.reference_mm[stretch], data, values, self.letter, lanes)
            run, many = self._run(constants, reference, data, courses, stretch, start)
            for output in self.outputs:
                whole = run.outputs[OUTPUTS[output]]
                mean = whole.reshape(-1, many, whole.shape[1]).mean(axis=1)[:lanes]
                parts[output].append(seen_earlier(mean, data.t_s[stretch], values))
            carried = {k: v.reshape(-1, many)[:lanes, 0] for k, v in run.state.items() if k in own or k.startswith("backlash__")}
        return {output: np.concatenate(p, axis=1) for output, p in parts.items()}

    def _run(
        self,
        constants: Mapping[str, Floats],
        reference: Floats,
        data: AxisRunData,
        courses: Floats,
        stretch: slice,
        start: Mapping[str, Floats],
    ) -> tuple[AxisRun, int]:
        lanes = len(next(iter(constants.values())))
        many = len(courses)
        ticks = len(data.t_s[stretch])
        fill = -(-lanes * many // LANES) * LANES
        index = np.minimum(np.arange(fill) // many, lanes - 1)
        known = np.zeros(ticks) if data.disturbance_n is None else data.disturbance_n[stretch]
        force = known[None, :] + courses[:, stretch]
        own = reference.ndim == 2
        if own:  # each lane sees a reference of its own
            columns = np.repeat(reference, many, axis=0)
            force = np.tile(force, (lanes, 1))
            column = np.minimum(np.arange(fill), lanes * many - 1)
        else:
            columns = np.broadcast_to(reference, (many, ticks))
            column = np.arange(fill) % many
        run = run_axes(
            {name: value[index] for name, value in constants.items()},
            AxisInput(columns, column, force),
            period_s=self.period_s,
            effects=tuple(e.name for e in axis_effects()),
            outputs=("position_mm", "torque_a", "table_mm"),
            start={name: np.broadcast_to(value, (lanes,))[index] for name, value in start.items()},
            first_tick=stretch.start,
        )
        return run, many

    def _constants(self, model: Model, theta: Floats) -> dict[str, Floats]:
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
        values: Mapping[Effected, Mapping[str, Floats]],
        constants: Mapping[str, Floats],
        data: AxisRunData,
        where: slice,
        lanes: int,
    ) -> dict[str, Floats]:
        """The state at the first sample of a stretch, as the sensors of each lane would have it."""
        reference = data.reference_mm[where]
        position = data.measured.get("pos_mm", data.measured.get("table_mm", data.reference_mm))[where]
        torque = data.measured["torque_a"][where] if "torque_a" in data.measured else np.zeros(len(reference))
        read = start_state(self.axis, reference, position, torque, self.period_s)
        state = {k: np.full(lanes, v) for k, v in read.items()} | self._start_of_loops(values, read, float(reference[0]), lanes)
        if "torque_a" not in data.measured and self.axis.velocity_integral_gain_a_per_mm > 0.0:
            state["integral_a"] = constants.get("gravity__force_n", np.zeros(lanes)) / constants["newton_per_command"]
        held = constants["newton_per_command"] * state["integral_a"] - constants.get("gravity__force_n", 0.0)
        static = np.where(held > 0.0, constants["static_plus_n"], constants["static_minus_n"])
        held = np.clip(held, -static, static)
        state["bristle_mm"] = held / constants["presliding__stiffness_n_per_mm"]
        return state

    def _start_of_loops(
        self, values: Mapping[Effected, Mapping[str, Floats]], read: Mapping[str, float], reference_mm: float, lanes: int
    ) -> dict[str, Floats]:
        """Position and integrals of the loops whose position and torque the sensors of each lane read as `read`."""
        position = Sensing.of(values, f"{self.letter}_pos_mm").value(np.full(lanes, read["position_mm"]))
        integral = np.full(lanes, read["integral_a"])
        if self.axis.velocity_integral_gain_a_per_mm > 0.0:
            gain = self.axis.velocity_gain_a_s_per_mm + self.axis.velocity_integral_gain_a_per_mm * self.period_s
            part = gain * self.axis.position_gain_per_s  # of the torque that the position loop asks for
            torque = integral + part * (reference_mm - read["position_mm"])
            integral = Sensing.of(values, f"{self.letter}_torque_a").value(torque) - part * (reference_mm - position)
        return {"position_mm": position, "integral_a": integral}

    def _courses(self, ticks: int) -> Floats:
        if self.disturbance is None:
            return np.zeros((1, ticks))
        half = self.disturbance.courses(self.pairs, ticks, self.period_s, seed=[11, ord(self.letter[0])])
        return np.concatenate([half, -half])


def _late(
    reference: Floats, data: AxisRunData, values: Mapping[Effected, Mapping[str, Floats]], letter: str, lanes: int
) -> Floats:
    """The reference that the loop sees: (n,), or (lanes, n) where it sees it late."""
    delay = values.get(Effected("command_delay", letter), {}).get("delay_s")
    if delay is None or not delay.any():
        return reference
    ticks = np.arange(len(reference))
    period_s = float(data.t_s[1] - data.t_s[0])
    return np.stack([np.interp(ticks - d / period_s, ticks, reference) for d in np.broadcast_to(delay, (lanes,))])


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
