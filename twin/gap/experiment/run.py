"""A program of the menu, run on a hypothesis: what each signal would show, and how much of that the constants could hide.

The machine is cut down to what the program works with, and its disturbance to a few courses, so that a run takes some hundredths
of a second. Sensitivities are differences over one standard deviation of each constant.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import effect_named
from twin.effects.effect import On, called
from twin.errors import MachineError, TwinError
from twin.gap.diagnosis import Effected
from twin.gap.experiment.envelope import Envelope
from twin.gap.experiment.menu import Shows, Snippet
from twin.gap.stages.free import effect_parameters
from twin.learned.standing import moved_by
from twin.machine import AddedEffect, MachineFile
from twin.motion.motion import Motion
from twin.motion.path import EventKind, path_from_moves
from twin.motion.plan import Plan, plan
from twin.motion.sampling import sampled
from twin.programs import Settings, interpret
from twin.runlog import AXIS_COLUMN
from twin.simulator.response import RunInput, respond
from twin.simulator.simulation import IDEAL_TIMES

Floats = NDArray[np.float64]
Columns = dict[str, Floats]

TAU = 2.0 * np.pi
COURSES = 4
TICKS_MANY = 60_000
"""A longer run is one course."""
HEAT_PERIOD_S = 2.0
AMBIENT_C = 22.0
PARAMETER_SIGMA = 0.1
"""Relative standard deviation of the parameters of an effect that was fitted."""
FRICTION = ("coulomb_n", "static_n", "stribeck_velocity_mm_s", "viscous_n_s_per_mm")
MACHINE_PATHS = {
    Shows.AXIS: (),
    Shows.SPINDLE: ("spindle.efficiency", "spindle.idle_power_kw"),
    Shows.CUT: (
        "tool.tangential_coefficient_n_per_mm2",
        "tool.radial_ratio",
        "spindle.efficiency",
        "spindle.idle_power_kw",
    ),
    Shows.HEAT: (
        "thermal.alpha_w_per_pct_rpm2",
        "thermal.beta_w_per_rpm",
        "thermal.resistance_k_per_w",
        "thermal.capacity_j_per_k",
    ),
}


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """A program of the menu, planned: what the machine is told, the rows that count, and the seconds that it takes."""

    snippet: Snippet
    told: RunInput
    recorded: Mapping[str, Floats]
    counts: NDArray[np.bool_]
    seconds: float


def trial_of(snippet: Snippet, machine: MachineFile, envelope: Envelope) -> Trial:
    """The program planned on the machine's control, or on a middling one where none is stated.

    Raises MachineError where it moves an axis that programs have no word for, as the joint of a robot.
    """
    if unknown := [letter for letter in snippet.letters if letter not in machine.words]:
        raise MachineError(f"no program moves {', '.join(unknown)}; it has words for {', '.join(machine.words)}")
    moves = interpret(snippet.program(), Settings(dialect="fanuc", axes=machine.words))
    planned = plan(path_from_moves(moves, axes=machine.words), machine.program or IDEAL_TIMES)
    heat = snippet.shows is Shows.HEAT
    motion = sampled(planned, HEAT_PERIOD_S if heat else machine.machine.servo_period_s)
    block = motion.line - 1  # the first line is the %
    counts = block >= snippet.from_block
    reference = {a: np.ascontiguousarray(motion.reference_mm[:, i]) for i, a in enumerate(planned.path.axes)}
    if snippet.shows is Shows.AXIS:
        return Trial(snippet, RunInput(motion.t_s, {a: reference[a] for a in snippet.letters}), {}, counts, planned.total_s)
    if heat:
        return _heat_trial(snippet, machine, planned, motion, counts)
    angle = np.mod(np.cumsum(motion.spindle_rpm) * (TAU / 60.0 * machine.machine.servo_period_s), TAU)
    told = RunInput(motion.t_s, reference, spindle_rpm=motion.spindle_rpm, spindle_angle_rad=angle)
    cut = envelope.cut
    if snippet.shows is Shows.CUT and cut is not None:
        cutting = np.isin(block, list(snippet.cuts)) & (motion.feed_mm_min > 0.0)
        whole = np.ones(len(motion))
        told = replace(
            told,
            axial_depth_mm=np.where(cutting, cut.axial_depth_mm, 0.0),
            entry_angle_rad=cut.entry_angle_rad * whole,
            exit_angle_rad=cut.exit_angle_rad * whole,
        )
    return Trial(snippet, told, {}, counts, planned.total_s)


def _heat_trial(snippet: Snippet, machine: MachineFile, planned: Plan, motion: Motion, counts: NDArray[np.bool_]) -> Trial:
    """A program that only turns the spindle, under its idle load."""
    told = RunInput(
        motion.t_s,
        spindle_rpm=motion.spindle_rpm,
        coolant_on=_coolant(planned, motion.t_s),
        ambient_temp_c=np.full(len(motion), AMBIENT_C),
        start_temp_c=AMBIENT_C,
    )
    spindle = machine.spindle
    idle_pct = 2.0 if spindle is None else 100.0 * spindle.idle_power_kw / spindle.rated_power_kw
    load = np.where(motion.spindle_rpm > 0.0, idle_pct, 0.0)
    return Trial(snippet, told, {"spindle_load_pct": load}, counts, planned.total_s)


def _coolant(planned: Plan, t_s: Floats) -> Floats:
    on = np.zeros(len(t_s))
    for event, start in zip(planned.path.events, planned.event_start_s, strict=True):
        if event.kind == EventKind.COOLANT:
            on[t_s >= start] = float(event.value > 0)
    return on


def shown(machine: MachineFile, trial: Trial) -> Columns:
    """Return the signals of a machine in the rows that count."""
    courses = COURSES if len(trial.told.t_s) < TICKS_MANY else 1
    less = cut_down(machine, trial.snippet)
    # a machine is enabled, and its integrators hold what there is to hold, long before a program starts
    told = replace(trial.told, start={axis: {"integral_a": torque} for axis, torque in _held_a(less).items()})
    response = respond(less, told, recorded=trial.recorded, courses=courses)
    kept = trial.recorded.keys() | {"cutting_force_peak_n"}
    return {name: values[trial.counts] for name, values in response.columns.items() if name not in kept}


def _held_a(machine: MachineFile) -> dict[str, float]:
    """Axis → what its integrator holds at rest, for the loads that the machine's effects put on it."""
    held: dict[str, float] = {}
    for added in machine.effects:
        if load_n := effect_named(added.effect).at_rest.get("load_n"):
            torque = called(load_n, added.parameters) / machine.axes[added.on].newton_per_command
            held[added.on] = held.get(added.on, 0.0) + torque
    return held


def cut_down(machine: MachineFile, snippet: Snippet) -> MachineFile:
    """The machine with no more axes, and no more effects, than the program works with."""
    letters = set(snippet.letters)
    axes = {a: axis for a, axis in machine.axes.items() if a in letters}

    def stays(added: AddedEffect) -> bool:
        on = effect_named(added.effect).on
        if on is On.AXIS:
            return added.on in axes
        match = AXIS_COLUMN.match(added.on)
        return match is None or match[1] in axes

    kept = {"effects": tuple(e for e in machine.effects if stays(e)), "learned": moved_by(machine.learned, letters)}
    return machine.model_copy(update={"axes": axes} | kept)


def sensitivities(
    effected: Effected, machine: MachineFile, trial: Trial, base: Columns, nuisance: Mapping[str, float]
) -> list[Columns]:
    """Return the change in the signals by a standard deviation of each constant, and of each parameter of the effect."""
    changed = [with_constant(machine, p, float(np.exp(s))) for p, s in _uncertain(machine, trial.snippet, nuisance).items()]
    changed += _other_parameters(effected, machine)
    found = []
    for other in changed:
        try:
            columns = shown(other, trial)
        except TwinError:  # one step out of the bounds of a parameter: it is at its end, and hides nothing there
            continue
        found.append({name: values - base[name] for name, values in columns.items() if name in base})
    return found


def _other_parameters(effected: Effected, machine: MachineFile) -> list[MachineFile]:
    """The machine with each parameter of the effect a tenth smaller."""
    effect = effect_named(effected.effect)
    changed = []
    for added in machine.effects:
        if (added.effect, added.on) != (effected.effect, effected.on):
            continue
        others = tuple(e for e in machine.effects if e is not added)
        whole = effect.checked(added.parameters)
        for free in effect_parameters(effect):
            name = free.name.partition("__")[2]
            if not np.isfinite(whole[name]):
                continue
            step = PARAMETER_SIGMA if free.is_angle or not whole[name] else PARAMETER_SIGMA * whole[name]
            moved = added.model_copy(update={"parameters": whole | {name: whole[name] - step}})
            changed.append(machine.model_copy(update={"effects": (*others, moved)}))
    return changed


def _uncertain(machine: MachineFile, snippet: Snippet, nuisance: Mapping[str, float]) -> dict[str, float]:
    """Path → relative standard deviation, of the constants that the program depends on."""
    paths = [path for path in MACHINE_PATHS[snippet.shows] if getattr(machine, path.partition(".")[0]) is not None]
    if snippet.shows is Shows.AXIS:
        for letter in snippet.letters:
            if letter in machine.axes:
                paths += [f"axes.{letter}.mass_kg", *(f"axes.{letter}.friction.{name}" for name in FRICTION)]
    stated = {path: machine.uncertainty.get(path, machine.uncertainty.get("relative", 0.05)) for path in paths}
    known = {path: nuisance.get(path, sigma) for path, sigma in stated.items()}
    return {path: sigma for path, sigma in known.items() if sigma > 0.0}


def with_constant(machine: MachineFile, path: str, factor: float) -> MachineFile:
    """The machine with the constant at `path` times a factor."""

    def changed(section: Any, keys: list[str]) -> Any:
        first, *rest = keys
        value = section[first] if isinstance(section, dict) else getattr(section, first)
        if rest:
            new = changed(value, rest)
        elif isinstance(value, tuple):
            new = tuple(v * factor for v in value)
        else:
            new = value * factor
        return section | {first: new} if isinstance(section, dict) else section.model_copy(update={first: new})

    result = changed(machine, path.split("."))
    assert isinstance(result, MachineFile)
    return result
