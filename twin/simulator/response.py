"""The response of a machine to what it is told: the whole chain of sites, for one run.

    reference → controller → drive force → friction → mechanics   (twin.servo, one lane an axis)
         └→ process force (twin.process) ──┘ └→ spindle (twin.spindle) → thermal (twin.heat) → sensor → clock (twin.sensor)

Depth and angles of the cut, speed of the spindle and the reference are inputs, so the process force needs nothing of the axes,
and the chain has no loop. Any column can be given from a recording instead: what is downstream of it then runs on the measured
one, and what is left of a gap lies there.

A machine with a disturbance (`[noise] disturbance_force_n`) is a distribution of courses: its response is their mean and their
spread, or, with a seed, one of them, with the noise of its sensors on top, as a real machine would record it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from twin.effects.added import added_effects, check_effects
from twin.effects.catalogue import effect_named
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants, thermal_quantities
from twin.kernels.weave import quantities
from twin.learned.arguments import around, motion_arguments, other_axes
from twin.learned.cutting import cut_arguments, cut_series, milling_with_terms
from twin.learned.sites import MACHINE_READINGS, READINGS
from twin.learned.standing import axis_terms, reading_series, settled, terms_at
from twin.learned.words import LearnedSite
from twin.machine import MachineFile
from twin.process.kernel import process_quantities
from twin.process.milling import Milling, tool_constants
from twin.rotary import outside_name
from twin.sensor.clock import looked_at, resampled, stamped
from twin.sensor.reading import readings
from twin.sensor.sensing import sensor_quantities
from twin.servo.constants import axis_constants, effect_constants
from twin.servo.disturbance import Disturbance
from twin.servo.kernel import axis_quantities
from twin.servo.run import AxisInput, AxisRun, run_axes
from twin.simulator.peaks import peaks
from twin.spindle.load import spindle_constants, spindle_load_pct, spindle_quantities

Floats = NDArray[np.float64]
HEAT_SITES = (LearnedSite.HEAT_INPUT, LearnedSite.HEAT_LOSS)
COURSES = 32
COURSES_SEED = 20
NOISE_OF = {"pos_mm": "position_mm", "table_mm": "table_mm", "torque_a": "torque_a"}
SENSOR_NOISE = {
    "force_x_n": "force_n",
    "force_y_n": "force_n",
    "spindle_load_pct": "spindle_load_pct",
    "spindle_temp_c": "spindle_temp_c",
}


@dataclass(frozen=True, slots=True, eq=False)
class RunInput:
    """The commands to a machine, and its surroundings; arrays (n,) over `t_s`.

    reference_mm: axis letter → (n,), evenly sampled at the servo period; none where the run is of slow signals only
    spindle_rpm, spindle_angle_rad, axial_depth_mm, entry_angle_rad, exit_angle_rad: of the cut; None = nothing is cut
    coolant_on, ambient_temp_c: of the heat; None = never on, not known
    start: axis letter → the state of the axis at the first tick (`twin.servo.run`); start_temp_c: of the spindle
    tool: number of the one in the spindle, where the machine describes several; empty = [tool]
    """

    t_s: Floats
    reference_mm: Mapping[str, Floats] = field(default_factory=dict)
    spindle_rpm: Floats | None = None
    spindle_angle_rad: Floats | None = None
    axial_depth_mm: Floats | None = None
    entry_angle_rad: Floats | None = None
    exit_angle_rad: Floats | None = None
    coolant_on: Floats | None = None
    ambient_temp_c: Floats | None = None
    start: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    start_temp_c: float | None = None
    tool: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """The response of the machine: columns of a run log → (n,), and the spread of its courses, standard deviation → (n,)."""

    columns: dict[str, Floats]
    spread: dict[str, Floats]


def respond(
    machine: MachineFile,
    told: RunInput,
    *,
    recorded: Mapping[str, Floats] | None = None,
    seed: int | None = None,
    courses: int = COURSES,
    reference_run: bool = False,
) -> Response:
    """The response of `machine` to what it is `told`.

    recorded: columns that are taken from a recording in place of the model's: `{a}_pos_mm` (then its torque is the controller's
    answer to the measured motion), `{a}_torque_a` (then the motion is the plant's answer to the measured torque), `force_x_n`
    with `force_y_n`, `spindle_load_pct`
    seed: None = mean and spread over `courses` of the machine's disturbance; else one course, with the noise of its sensors

    Raises EffectError where the machine's effects do not fit it.
    """
    check_effects(machine)
    machine = machine.with_tool(told.tool)
    chain = _Chain(machine, told, recorded or {}, reference_run)
    force = chain.process()
    temperature_c = chain.heat()
    chain.axes(force, seed, courses, temperature_c)
    if temperature_c is not None:
        chain.columns["spindle_temp_c"] = temperature_c
    chain.sensors()
    if seed is not None:
        _noise(machine, chain.columns, np.random.default_rng([seed, 1]))
    return Response(chain.columns, chain.spread)


def period_of(t_s: Floats) -> float:
    """Spacing of evenly spaced times, s; 1 ms where there is no second one."""
    return float((t_s[-1] - t_s[0]) / (len(t_s) - 1)) if len(t_s) > 1 else 0.001


def milling_of(told: RunInput) -> Milling | None:
    """The cut of a run; None where it has none."""
    series = (told.spindle_rpm, told.spindle_angle_rad, told.axial_depth_mm, told.entry_angle_rad, told.exit_angle_rad)
    rpm, angle, depth, entry, leaving = series
    if rpm is None or angle is None or depth is None or entry is None or leaving is None:
        return None
    if not np.nan_to_num(depth).any() or "x" not in told.reference_mm or "y" not in told.reference_mm:
        return None
    period_s = period_of(told.t_s)
    speed = [np.gradient(told.reference_mm[axis], period_s) for axis in "xy"]
    return Milling(angle, rpm, speed[0], speed[1], depth, entry, leaving)


def _named(prefix: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Effect parameters under the names that woven text takes."""
    return {f"{e}__{k}": v for e, given in prefix.items() for k, v in effect_named(e).checked(given).items()}


@dataclass(frozen=True, slots=True, eq=False)
class _Chain:
    """The sites of one run, in order; each adds its columns. depended: axis letter → the arguments of learned terms on it"""

    machine: MachineFile
    told: RunInput
    recorded: Mapping[str, Floats]
    reference_run: bool
    columns: dict[str, Floats] = field(default_factory=dict)
    spread: dict[str, Floats] = field(default_factory=dict)
    depended: dict[str, Mapping[str, Floats]] = field(default_factory=dict)

    def process(self) -> dict[str, Floats]:
        """Adds forces and load; the mean force of each tick that resists an axis, by its letter."""
        machine, told = self.machine, self.told
        period_s = period_of(told.t_s)
        milling = milling_of(told) if machine.tool else None
        power_w = np.zeros(len(told.t_s))
        mean: dict[str, Floats] = {}
        if milling is not None and machine.tool is not None:
            effects = added_effects(self.machine, process_quantities())
            constants = tool_constants(machine.tool) | _named(effects)
            named = tuple(effects)
            terms = terms_at(machine.learned, {LearnedSite.CUT_FORCE})
            arguments = self.arguments(None) | cut_arguments(milling, machine.tool.teeth) if terms else {}
            options = {"period_s": period_s, "effects": named, "reference_run": self.reference_run}
            series = cut_series(terms, arguments)
            force = milling_with_terms(constants, machine.tool.teeth, milling, series, **options)
            self.columns["force_x_n"], self.columns["force_y_n"] = force.force_x_n[0], force.force_y_n[0]
            feed = 60.0 * np.hypot(milling.velocity_x_mm_s, milling.velocity_y_mm_s)
            cut = (milling.axial_depth_mm, milling.entry_angle_rad, milling.exit_angle_rad)
            told_cut = (milling.spindle_rpm, feed, *cut)
            self.columns["cutting_force_peak_n"] = peaks(constants, machine.tool.teeth, named, told_cut, terms, arguments)
            mean = {"x": -force.mean_force_x_n[0], "y": -force.mean_force_y_n[0]}
            power_w = force.cutting_power_w()[0]
        for axis in "xy":
            if f"force_{axis}_n" in self.recorded:
                mean[axis] = -np.nan_to_num(self.recorded[f"force_{axis}_n"])
        if machine.spindle is not None and told.spindle_rpm is not None and told.reference_mm:
            effects = added_effects(self.machine, spindle_quantities())
            spindle, rpm = spindle_constants(machine.spindle) | _named(effects), told.spindle_rpm

            def load(added: Mapping[str, Floats]) -> Floats:
                found = spindle_load_pct(
                    spindle,
                    power_w,
                    rpm,
                    period_s=period_s,
                    effects=tuple(effects),
                    added_kw=added.get("electrical_power_kw"),
                    reference_run=self.reference_run,
                )
                return np.asarray(found[0])

            terms = terms_at(machine.learned, {LearnedSite.SPINDLE_POWER})
            self.columns["spindle_load_pct"] = settled(
                terms, load, lambda bare: self.arguments(None) | {"load_pct": bare}, passes_max=1
            )
        return mean

    def axes(self, mean_force: Mapping[str, Floats], seed: int | None, courses: int, temperature_c: Floats | None) -> None:
        """Adds position, table and torque of each axis that the machine has."""
        disturbance = disturbance_of(self.machine)
        many = courses if disturbance and seed is None else 1
        for number, (letter, reference) in enumerate((a, r) for a, r in self.told.reference_mm.items() if a in self.machine.axes):
            force = np.tile(mean_force.get(letter, np.zeros(len(reference))), (many, 1))
            if disturbance:
                chance = [COURSES_SEED, number] if seed is None else [seed, 2, number]
                force = force + disturbance.courses(many, len(reference), self.machine.machine.servo_period_s, chance)
            run = self.axis(letter, reference, force, many, temperature_c)
            for output, column in (("position_mm", "pos_mm"), ("torque_a", "torque_a"), ("table_mm", "table_mm")):
                self.columns[f"{letter}_{column}"] = run.outputs[output].mean(axis=0)
                if many > 1:
                    self.spread[f"{letter}_{column}"] = run.outputs[output].std(axis=0)

    def axis(self, letter: str, reference: Floats, force: Floats, many: int, temperature_c: Floats | None) -> AxisRun:
        """One axis over all its courses."""
        period_s = self.machine.machine.servo_period_s
        base = axis_constants(self.machine.axes[letter])
        effects = added_effects(self.machine, axis_quantities(), letter)
        for name, given in effects.items():
            base |= effect_constants(effect_named(name), given, base, letter)
        replaced = _replaced(letter, self.recorded, period_s)
        seen = _seen_reference(reference, self.told.t_s, self.machine, letter)

        def run(added: Mapping[str, Floats]) -> AxisRun:
            return run_axes(
                {name: np.full(many, value) for name, value in base.items()},
                AxisInput(
                    np.tile(seen, (many, 1)),
                    np.arange(many),
                    force if force.any() else None,
                    {name: np.tile(values, (many, 1)) for name, values in replaced.items()},
                    {name: np.tile(values, (many, 1)) for name, values in added.items()},
                ),
                period_s=period_s,
                effects=tuple(effects),
                outputs=("position_mm", "torque_a", "table_mm"),
                start=self.told.start.get(letter),
                reference_run=self.reference_run,
            )

        terms = axis_terms(self.machine.learned, letter)
        if not terms:
            return run({})
        fixed = self.arguments(temperature_c) | motion_arguments(self.told.t_s, reference)

        def arguments(found: AxisRun) -> dict[str, Floats]:
            position, torque = (found.outputs[name].mean(axis=0) for name in ("position_mm", "torque_a"))
            position = self.recorded.get(f"{letter}_pos_mm", position)
            return fixed | {"position_mm": position, "torque_a": self.recorded.get(f"{letter}_torque_a", torque)}

        answer = settled(terms, run, arguments)
        self.depended[letter] = arguments(answer)
        return answer

    def arguments(self, temperature_c: Floats | None) -> dict[str, Floats]:
        """The arguments of learned terms that the machine as a whole tells."""
        told = self.told
        load = self.recorded.get("spindle_load_pct", self.columns.get("spindle_load_pct"))
        columns = {
            "spindle_rpm": told.spindle_rpm,
            "spindle_angle_rad": told.spindle_angle_rad,
            "axial_depth_mm": told.axial_depth_mm,
            "coolant_on": told.coolant_on,
            "spindle_load_pct": load,
            "spindle_temp_c": temperature_c,
            "ambient_temp_c": told.ambient_temp_c,
        }
        return around(told.t_s, columns) | other_axes(told.t_s, told.reference_mm)

    def heat(self) -> Floats | None:
        """The spindle's temperature where the machine states its heat, and load, speed and surroundings are known."""
        thermal, told = self.machine.thermal, self.told
        load = self.recorded.get("spindle_load_pct", self.columns.get("spindle_load_pct"))
        if thermal is None or load is None or told.spindle_rpm is None or told.ambient_temp_c is None:
            return None
        ambient_c = float(told.ambient_temp_c[np.isfinite(told.ambient_temp_c)][0])
        effects = added_effects(self.machine, thermal_quantities())
        constants = thermal_constants(thermal) | _named(effects)
        warming = Warming(told.t_s, load, told.spindle_rpm, told.ambient_temp_c, told.coolant_on)

        def warm(added: Mapping[str, Floats]) -> Floats:
            found = spindle_temperature_c(
                constants,
                warming,
                ambient_c if told.start_temp_c is None else told.start_temp_c,
                effects=tuple(effects),
                added_w=added.get("heat_w"),
                reference_run=self.reference_run,
            )
            return np.asarray(found[0])

        return settled(terms_at(self.machine.learned, HEAT_SITES), warm, self.arguments)

    def sensors(self) -> None:
        """Turns what is into what is recorded: sensors first, then the clock that stamps them."""
        t_s = self.told.t_s
        since = np.diff(t_s, prepend=t_s[:1])
        temperature = self.columns.get("spindle_temp_c")
        rise = None if temperature is None else temperature - temperature[0]
        reading_terms = terms_at(self.machine.learned, {*READINGS, *MACHINE_READINGS})
        for name in list(self.columns):
            effects = added_effects(self.machine, sensor_quantities(), name)
            if name.endswith("_table_mm"):
                effects |= added_effects(self.machine, sensor_quantities(), name.removesuffix("_table_mm"))
            self.columns[name] = readings(self.columns[name], since, effects, rise, self.reference_run)
            if reading_terms:
                depended = self.depended.get(name.partition("_")[0]) or self.arguments(temperature)
                learned = reading_series(reading_terms, name, depended)
                self.columns[name] = self.columns[name] if learned is None else self.columns[name] + learned
        drifting = added_effects(self.machine, quantities((stamped,)))
        if drifting and self.told.reference_mm:
            at_s = _mapped(t_s, drifting, "feedback_time_s") - t_s[0]
            for values in (self.columns, self.spread):
                for name in values:
                    if name.endswith(("_pos_mm", "_table_mm", "_torque_a")):
                        values[name] = resampled(values[name], period_of(t_s), at_s)


def disturbance_of(machine: MachineFile) -> Disturbance | None:
    """The disturbance that the machine states under [noise]."""
    force_n = machine.noise.get("disturbance_force_n", 0.0)
    return Disturbance(force_n, machine.noise.get("disturbance_correlation_s", 0.05)) if force_n > 0.0 else None


def _replaced(letter: str, recorded: Mapping[str, Floats], period_s: float) -> dict[str, Floats]:
    """Recorded columns of an axis as the quantities that they replace."""
    replaced: dict[str, Floats] = {}
    if f"{letter}_pos_mm" in recorded:
        position = recorded[f"{letter}_pos_mm"]
        replaced |= {"position_mm": position, "velocity_mm_s": np.gradient(position, period_s)}
    if f"{letter}_torque_a" in recorded:
        replaced["torque_a"] = recorded[f"{letter}_torque_a"]
    return replaced


def _seen_reference(reference: Floats, t_s: Floats, machine: MachineFile, letter: str) -> Floats:
    """The reference that the loop of an axis sees."""
    effects = added_effects(machine, quantities((looked_at,)), letter)
    if not effects:
        return reference
    return resampled(reference, period_of(t_s), _mapped(t_s, effects, "reference_time_s") - t_s[0])


def _mapped(t_s: Floats, effects: Mapping[str, Mapping[str, float]], quantity: str) -> Floats:
    """A time as the effects change it; their functions take arrays as they take numbers."""
    seen = t_s
    for name, given in effects.items():
        effect = effect_named(name)
        known = effect.checked(given) | {"time_s": t_s}
        change = effect.changes[quantity]
        taken = change.__code__.co_varnames[1 : change.__code__.co_argcount]
        seen = np.asarray(change(seen, *(known[argument] for argument in taken)))
    return seen


def noise_key(machine: MachineFile, column: str) -> str:
    """Return the key of [noise] that states the noise of a column; empty where there is none."""
    letter, _, rest = column.partition("_")
    key = SENSOR_NOISE.get(column) or NOISE_OF.get(rest, "")
    return outside_name(key)[0] if letter in machine.rotary else key


def _noise(machine: MachineFile, columns: dict[str, Floats], chance: np.random.Generator) -> None:
    """Adds what the sensors make of it."""
    for name, values in columns.items():
        sigma = machine.noise.get(noise_key(machine, name), 0.0)
        if sigma > 0.0:
            columns[name] = values + sigma * chance.standard_normal(len(values))
