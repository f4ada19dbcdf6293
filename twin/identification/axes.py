"""Identifies the axes of a machine, and the disturbance that its runs differ by."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from twin.case import Run
from twin.identification.axis_fit import AxisFit, AxisModel, AxisRecording, fit_axis, noise_by_regime, stretches
from twin.identification.axis_parameters import (
    GAINS,
    VELOCITY_DELAY,
    AxisParameter,
    axis_parameters,
    effects_of,
    identified_axis,
)
from twin.identification.cutting_fit import force_of
from twin.identification.disturbance_fit import fit_disturbance
from twin.identification.estimate import INTERVAL_Z, KNOWN_MIN, Estimate
from twin.machine import AddedEffect, MachineFile
from twin.regimes import axis_regimes
from twin.simulator.recorded import noise_of

Floats = NDArray[np.float64]
DELAY_GAIN_MIN = 0.05
"""Part of the residual that a delayed velocity has to take away before the twin is told of one."""
DELAY_SIGMAS = 5.0


def identified_axes(
    machine: MachineFile,
    runs: tuple[Run, ...],
    repeats: tuple[tuple[Run, Run], ...],
    free_gains: bool,
    known: list[Estimate],
    unknown: list[str],
    notes: list[str],
    progress: Callable[[str], None],
) -> MachineFile:
    """The machine with its axes identified; what was found is added to the lists."""
    axes = dict(machine.axes)
    fits: dict[str, tuple[AxisFit, tuple[AxisRecording, ...], dict[str, float]]] = {}
    effects = list(machine.effects)
    for letter in machine.axes:
        progress(f"axis {letter}")
        recordings, noise = _recordings(machine, runs, repeats, letter)
        moving = tuple(stretch for recording in recordings for stretch in stretches(recording))
        if not moving:
            there = ", ".join(dict.fromkeys(a for run in runs for a in run.log.axes())) or "none"
            unknown.append(
                f"axes.{letter}: no run has {letter}_ref_mm, {letter}_pos_mm and {letter}_torque_a while it moves; "
                f"axes in the runs: {there}"
            )
            continue
        forced = any(r.disturbance_n is not None and r.disturbance_n.any() for r in recordings)
        parameters = axis_parameters(machine, letter, force_known=forced, free_gains=free_gains)
        found = _with_or_without_delay(AxisModel(axes[letter], parameters, moving, machine.machine.servo_period_s), notes, letter)
        parameters = found.model.parameters
        axes[letter] = identified_axis(machine.axes[letter], parameters, found.theta)
        for name in effects_of(parameters):
            value = float(found.theta[[p.name for p in parameters].index(VELOCITY_DELAY.name)])
            effects.append(AddedEffect(effect=name, on=letter, parameters={"delay_s": value}))
        known += _estimates(machine, letter, found)
        notes += _scale_factors(letter, found)
        unknown += _unknown(letter, found, forced)
        fits[letter] = (found, recordings, noise)
    machine = machine.model_copy(update={"axes": axes, "effects": tuple(effects)})
    return _with_disturbance(machine, fits, notes, progress)


def _recordings(
    machine: MachineFile, runs: tuple[Run, ...], repeats: tuple[tuple[Run, Run], ...], letter: str
) -> tuple[tuple[AxisRecording, ...], dict[str, float]]:
    """The axis in each run that records it, and the noise of its sensors."""
    found, noise = [], {"position_mm": 0.0, "torque_a": 0.0}
    columns = {"position_mm": f"{letter}_pos_mm", "torque_a": f"{letter}_torque_a"}
    for run in runs:
        log = run.log
        if not log.has(f"{letter}_ref_mm", *columns.values()):
            continue
        regimes = axis_regimes(log.t_s, log[f"{letter}_ref_mm"])
        pairs = [(a, b) for a, b in repeats if run in (a, b) and len(a.log) == len(b.log) and b.log.has(*columns.values())]
        sigma = []
        for name, column in columns.items():
            noise[name] = max(noise[name], noise_of(machine, log, column))
            differences = [a.log[column] - b.log[column] for a, b in pairs if a.log.has(column)]
            sigma.append(noise_by_regime(regimes, noise[name], differences))
        force = _force_on(machine, run, letter)
        series = (log.t_s, log[f"{letter}_ref_mm"], log[columns["position_mm"]], log[columns["torque_a"]])
        found.append(AxisRecording(*series, force, np.array(sigma)))
    return tuple(found), noise


def _force_on(machine: MachineFile, run: Run, letter: str) -> Floats | None:
    """The cutting force on an axis, by the coefficients identified before, as a force that resists motion in +."""
    force = force_of(machine, run.log) if letter in ("x", "y") else None
    if force is None:
        return None
    return -np.asarray((force.mean_force_x_n if letter == "x" else force.mean_force_y_n)[0])


def _with_or_without_delay(model: AxisModel, notes: list[str], letter: str) -> AxisFit:
    """The fit with the nominal loop, or with an old velocity in it where that takes much of the residual away."""
    later = AxisModel(model.axis, (*model.parameters, VELOCITY_DELAY), model.recordings, model.period_s)
    nominal, delayed = fit_axis(model), fit_axis(later)
    delay = float(delayed.theta[-1])
    deviation = float(np.sqrt(delayed.found.covariance[-1, -1]))
    left = [float(np.linalg.norm(m.left_over(f.theta))) for m, f in ((model, nominal), (later, delayed))]
    part = 1.0 - left[1] / left[0]
    if delay < DELAY_SIGMAS * deviation or part < DELAY_GAIN_MIN:  # a velocity from the future is another fault's disguise
        return nominal
    notes.append(
        f"axes.{letter}: the velocity in the loop is {1000 * delay:.3f} ± {1000 * INTERVAL_Z * deviation:.3f} ms old; with that "
        f"in it the residual is {100 * part:.0f} % smaller, so the twin has {effects_of((VELOCITY_DELAY,))[0]} on {letter}"
    )
    return delayed


def _estimates(machine: MachineFile, letter: str, found: AxisFit) -> list[Estimate]:
    """Each parameter with its interval, in its own unit."""
    axis = machine.axes[letter]
    stated: dict[str, float] = {
        "mass_kg": axis.mass_kg,
        "newton_per_command": axis.newton_per_command,
        **{gain: getattr(axis, gain) for gain in GAINS},
        **{name: _mean(getattr(axis.friction, name)) for name in type(axis.friction).model_fields},
    }
    estimates = []
    for i, p in enumerate(found.model.parameters):
        theta, deviation = float(found.theta[i]), float(np.sqrt(found.found.covariance[i, i]))
        path = _path(letter, p, axis.force_per_command_n is not None)
        if p.relative:
            base = stated[p.name]
            if p.name == "newton_per_command" and axis.torque_constant_nm_per_a is not None:
                base = axis.torque_constant_nm_per_a
            low, high = (base * float(np.exp(theta + s * INTERVAL_Z * deviation)) for s in (-1.0, 1.0))
            estimates.append(Estimate(path, base * float(np.exp(theta)), low, high, p.unit, base, float(found.found.known[i])))
        else:
            low, high = theta - INTERVAL_Z * deviation, theta + INTERVAL_Z * deviation
            estimates.append(Estimate(path, theta, low, high, p.unit, 0.0, float(found.found.known[i])))
    return estimates


def _scale_factors(letter: str, found: AxisFit) -> list[str]:
    """Fitted gains as the factors S_pp, S_vp, S_vi on the stated ones."""
    factors = []
    for i, p in enumerate(found.model.parameters):
        if p.name in GAINS:
            factor, deviation = float(np.exp(found.theta[i])), float(np.sqrt(found.found.covariance[i, i]))
            factors.append(f"{GAINS[p.name]} = {factor:.4f} ± {INTERVAL_Z * deviation * factor:.4f}")
    return [f"axes.{letter}: {', '.join(factors)}"] if factors else []


def _mean(value: float | tuple[float, float]) -> float:
    return float(np.mean(value))


def _path(letter: str, parameter: AxisParameter, by_force: bool) -> str:
    friction = ("coulomb_n", "static_n", "stribeck_velocity_mm_s", "viscous_n_s_per_mm", "coulomb_asymmetry", "viscous_asymmetry")
    if parameter.name in friction:
        return f"axes.{letter}.friction.{parameter.name}"
    if parameter.name == "newton_per_command":
        return f"axes.{letter}.{'force_per_command_n' if by_force else 'torque_constant_nm_per_a'}"
    return f"axes.{letter}.{parameter.name.partition('__')[0]}"


def _unknown(letter: str, found: AxisFit, forced: bool) -> list[str]:
    """Return notes on what the runs of an axis cannot tell."""
    said = [
        f"{_path(letter, p, False)}: these runs do not excite it; the stated value and its uncertainty stand"
        for p, known in zip(found.model.parameters, found.found.known, strict=True)
        if known <= KNOWN_MIN
    ]
    if not forced:
        said.append(
            f"axes.{letter}: only the ratios of mass, friction and torque constant are known, because no run has a known force "
            "on this axis; the torque constant stays as stated"
        )
    return said


def _with_disturbance(
    machine: MachineFile,
    fits: dict[str, tuple[AxisFit, tuple[AxisRecording, ...], dict[str, float]]],
    notes: list[str],
    progress: Callable[[str], None],
) -> MachineFile:
    """The machine with the disturbance that its axes have in common, where they come to rest and so show it."""
    resting = {a: fit for a, fit in fits.items() if any((r.regimes() == 0).mean() > 0.05 for r in fit[1])}
    if not resting:
        return machine
    progress("disturbance")
    found = fit_disturbance([(fit, recordings, noise) for fit, recordings, noise in resting.values()])
    if found.disturbance is None:
        return machine
    force, correlation = found.disturbance.force_n, found.disturbance.correlation_s
    notes.append(
        f"a disturbance of {force:.2g} N with a correlation time of {1000 * correlation:.2g} ms explains how these runs differ "
        "and where the axes come to rest; the twin is the mean over its courses"
    )
    noise = dict(machine.noise) | {"disturbance_force_n": force, "disturbance_correlation_s": correlation}
    return machine.model_copy(update={"noise": noise})
