"""Identifies the disturbance: how large and how slow the force is that makes the runs of a machine differ.

For each candidate (σ, τ) the axis is simulated many times over; the candidate is scored by how well the mean and the spread of
those courses predict the recording, sample by sample (Gaussian log-likelihood with the moments of the ensemble, as in ensemble
Kalman filtering). The search is a grid with a finer one around its best point, no more: the twin moves little between neighbours.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.identification.axis_fit import SIGNALS, AxisFit, AxisRecording, start_of
from twin.identification.axis_parameters import constants_at, effects_of
from twin.servo.constants import axis_constants
from twin.servo.disturbance import CORRELATIONS_S, Disturbance
from twin.servo.run import AxisInput, run_axes

Floats = NDArray[np.float64]

COURSES = 32
SEED = 20
FORCES_N = (0.4, 0.9, 1.8, 3.5)


@dataclass(frozen=True, slots=True)
class DisturbanceFit:
    """The likeliest disturbance, or None where none is likelier than any; gain: in log-likelihood per sample over none."""

    disturbance: Disturbance | None
    gain: float


def predicted(
    fit: AxisFit, recording: AxisRecording, disturbance: Disturbance | None, seed: int = SEED
) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Mean and variance of position and torque over the courses of an axis, name → (n,)."""
    count = COURSES if disturbance else 1
    ticks = len(recording.t_s)
    model = fit.model
    constants = constants_at(axis_constants(model.axis), model.parameters, np.repeat(fit.theta[None, :], count, axis=0))
    force = (
        np.zeros((count, ticks)) if recording.disturbance_n is None else np.repeat(recording.disturbance_n[None], count, axis=0)
    )
    if disturbance:
        force = force + disturbance.courses(count, ticks, model.period_s, seed)
    inputs = AxisInput(np.repeat(recording.reference_mm[None, :], count, axis=0), np.arange(count), force)
    start = start_of(recording, model.axis, model.period_s)
    effects = effects_of(model.parameters)
    run = run_axes(constants, inputs, period_s=model.period_s, outputs=SIGNALS, start=start, effects=effects)
    means = {name: run.outputs[name].mean(axis=0) for name in SIGNALS}
    variances = {name: run.outputs[name].var(axis=0) for name in SIGNALS}
    return means, variances


Axis = tuple[AxisFit, tuple[AxisRecording, ...], dict[str, float]]
"""A fitted axis, its whole recordings (rests included), and the noise of its sensors by signal."""


def fit_disturbance(axes: Sequence[Axis]) -> DisturbanceFit:
    """The disturbance that these axes have in common."""
    grid = [Disturbance(force, correlation) for force in FORCES_N for correlation in CORRELATIONS_S]
    none = _score(axes, None)
    scored = [(_score(axes, candidate), candidate) for candidate in grid]
    likeliest = max(scored, key=lambda pair: pair[0])[1]
    around = [(f, c) for f in (0.7, 1.0, 1.4) for c in (0.5, 1.0, 2.0) if (f, c) != (1.0, 1.0)]
    finer = [Disturbance(likeliest.force_n * f, likeliest.correlation_s * c) for f, c in around]
    best, likeliest = max(scored + [(_score(axes, candidate), candidate) for candidate in finer], key=lambda pair: pair[0])
    return DisturbanceFit(likeliest, best - none) if best > none else DisturbanceFit(None, 0.0)


def _score(axes: Sequence[Axis], disturbance: Disturbance | None) -> float:
    """Log-likelihood per sample."""
    total, samples = 0.0, 0
    for found, recordings, noise in axes:
        for recording in recordings:
            means, variances = predicted(found, recording, disturbance)
            for name, measured in (("position_mm", recording.position_mm), ("torque_a", recording.torque_a)):
                variance = noise[name] ** 2 + variances[name]
                error = measured - means[name]
                # what is farther off than twenty times its spread says that the model is wrong, not how wide the spread is
                total -= float(np.nansum(np.log(variance) + np.minimum(error**2 / variance, 400.0))) / 2.0
                samples += len(measured)
    return total / max(samples, 1)
