"""Identifies the disturbance of an axis: how large and how slow the force is that makes its runs differ.

For each candidate (σ, τ) the axis is simulated many times over; the candidate is scored by how well the mean and the spread of
those courses predict the recording, sample by sample (Gaussian log-likelihood with the moments of the ensemble, as in ensemble
Kalman filtering). The grid is coarse on purpose: the answer moves the twin little between neighbours.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.identification.axis_fit import SIGNALS, AxisFit, AxisRecording, start_of
from twin.identification.axis_parameters import constants_at
from twin.servo.constants import axis_constants
from twin.servo.disturbance import Disturbance
from twin.servo.run import AxisInput, run_axes

Floats = NDArray[np.float64]

COURSES = 32
SEED = 20
FORCES_N = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.5)
CORRELATIONS_S = (0.005, 0.02, 0.06, 0.2)


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
    run = run_axes(constants, inputs, period_s=model.period_s, outputs=SIGNALS, start=start)
    means = {name: run.outputs[name].mean(axis=0) for name in SIGNALS}
    variances = {name: run.outputs[name].var(axis=0) for name in SIGNALS}
    return means, variances


def fit_disturbance(fit: AxisFit, recordings: tuple[AxisRecording, ...], noise: dict[str, float], scale: float) -> DisturbanceFit:
    """The disturbance of an axis from whole recordings, rests included.

    noise: of the sensors, by signal; scale: factor on the forces of the grid, about what 1 N is on an axis of 300 N of friction
    """

    def score(disturbance: Disturbance | None) -> float:
        total, samples = 0.0, 0
        for recording in recordings:
            means, variances = predicted(fit, recording, disturbance)
            for name, measured in (("position_mm", recording.position_mm), ("torque_a", recording.torque_a)):
                variance = noise[name] ** 2 + variances[name]
                error = measured - means[name]
                # what is farther off than twenty times its spread says that the model is wrong, not how wide the spread is
                total -= float(np.nansum(np.log(variance) + np.minimum(error**2 / variance, 400.0))) / 2.0
                samples += len(measured)
        return total / samples

    none = score(None)
    grid = [Disturbance(force * scale, correlation) for force in FORCES_N for correlation in CORRELATIONS_S]
    best = max(((score(candidate), candidate) for candidate in grid), key=lambda pair: pair[0])
    return DisturbanceFit(best[1], best[0] - none) if best[0] > none else DisturbanceFit(None, 0.0)
