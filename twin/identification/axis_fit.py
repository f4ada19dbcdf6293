"""Identifies an axis: the closed loop is simulated from the reference alone, and its constants are fitted to position and torque.

    min Σ ρ(((pos − pos^) / σ_pos)²) + ρ(((torque − torque^) / σ_torque)²) + Σ (θ / σ_θ)²,   ρ(z) = 2 (√(1 + z) − 1)

Nonlinear least squares (scipy's trust region), with all finite differences of a step in one batch of the simulator. Fitting the
loop, not the force balance, needs no acceleration, which a recording has not got; the start is the stated machine, whose
constants are a few percent off. σ is the noise by signal and regime: at rest, sticking makes the torque repeat worse than its
sensor, so those samples count less.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from twin.identification.axis_parameters import AxisParameter, constants_at
from twin.identification.estimate import clustered_covariance
from twin.machine import Axis
from twin.regimes import axis_regimes
from twin.servo.constants import axis_constants
from twin.servo.run import AxisInput, AxisRun, run_axes

Floats = NDArray[np.float64]
BLOCK_S = 1.0
SIGNALS = ("position_mm", "torque_a")


@dataclass(frozen=True, slots=True, eq=False)
class AxisRecording:
    """An axis in one run, evenly sampled at the servo period.

    reference_mm, position_mm, torque_a: (n,); disturbance_n: (n,) known force that resists motion in +, or None
    sigma: (2, n) noise of position and torque, by regime
    """

    t_s: Floats
    reference_mm: Floats
    position_mm: Floats
    torque_a: Floats
    disturbance_n: Floats | None
    sigma: Floats

    def cut(self, where: slice) -> "AxisRecording":
        """A stretch of it."""
        disturbance = None if self.disturbance_n is None else self.disturbance_n[where]
        series = (self.t_s[where], self.reference_mm[where], self.position_mm[where], self.torque_a[where])
        return AxisRecording(*series, disturbance, self.sigma[:, where])

    def regimes(self) -> NDArray[np.int8]:
        """Regime of each sample."""
        return axis_regimes(self.t_s, self.reference_mm)


REST_BEFORE_S = 0.1
REST_AFTER_S = 0.2


def stretches(recording: AxisRecording) -> tuple[AxisRecording, ...]:
    """The stretches of motion, each with a little of the rest before and after it; the whole where the axis never rests.

    While an axis sticks, its integrator creeps on an error of tenths of a micrometre, so the torque from which it breaks away after
    a long rest is chance. Fitted through, that chance would be taken for friction; each stretch therefore starts from the torque
    that was measured (multiple shooting: Bock 1981; for servo axes, Janot, Gautier, Brunot 2019 start each lap anew).
    """
    still = np.concatenate([[True], np.diff(recording.reference_mm) == 0])
    period_s = float(np.median(np.diff(recording.t_s)))
    before, after = round(REST_BEFORE_S / period_s), round(REST_AFTER_S / period_s)
    moving = np.flatnonzero(~still)
    if not len(moving):
        return ()
    breaks = np.flatnonzero(np.diff(moving) > before + after)
    firsts, lasts = moving[np.concatenate([[0], breaks + 1])], moving[np.concatenate([breaks, [len(moving) - 1]])]
    cuts = [slice(max(0, first - before), last + after) for first, last in zip(firsts, lasts, strict=True)]
    return tuple(recording.cut(where) for where in cuts)


def start_of(recording: AxisRecording, axis: Axis, period_s: float) -> dict[str, Floats | float]:
    """The state at the first sample: the mean of a standstill there, else a parabola through the first samples."""
    moving = np.flatnonzero(np.diff(recording.reference_mm) != 0)
    still = int(moving[0]) if len(moving) else len(recording.t_s)
    if still >= 20:
        position, velocity = float(np.mean(recording.position_mm[:still])), 0.0
        torque = float(np.mean(recording.torque_a[: min(still, 50)]))
    else:
        first = np.arange(12) * period_s
        _, velocity, position = np.polyfit(first, recording.position_mm[:12], 2)
        torque = float(np.polyfit(first, recording.torque_a[:12], 1)[1])
    error = axis.position_gain_per_s * (recording.reference_mm[0] - position) - velocity
    integral = torque - axis.velocity_gain_a_s_per_mm * error if axis.velocity_integral_gain_a_per_mm > 0 else 0.0
    step = (recording.reference_mm[1] - recording.reference_mm[0]) if still < 20 else 0.0
    return {
        "position_mm": float(position),
        "velocity_mm_s": float(velocity),
        "integral_a": float(integral) - axis.velocity_integral_gain_a_per_mm * float(error) * period_s,
        "previous_reference_mm": float(recording.reference_mm[0] - step),
        "previous_reference_velocity_mm_s": float(step / period_s),
    }


@dataclass(frozen=True, slots=True, eq=False)
class AxisModel:
    """The simulated axis as a function of its parameters, over all runs."""

    axis: Axis
    parameters: tuple[AxisParameter, ...]
    recordings: tuple[AxisRecording, ...]
    period_s: float

    def simulate(self, theta: Floats) -> list[AxisRun]:
        """A run for each recording, its outputs (candidates, n); theta: (candidates, p)."""
        constants = constants_at(axis_constants(self.axis), self.parameters, theta)
        runs = []
        for recording in self.recordings:
            disturbance = None if recording.disturbance_n is None else recording.disturbance_n[None, :]
            inputs = AxisInput(recording.reference_mm[None, :], np.zeros(len(theta), dtype=np.intp), disturbance)
            start = start_of(recording, self.axis, self.period_s)
            runs.append(run_axes(constants, inputs, period_s=self.period_s, outputs=SIGNALS, start=start))
        return runs

    def residuals(self, theta: Floats) -> Floats:
        """In units of the noise, (candidates, n), all runs and signals one after another."""
        parts = []
        for recording, run in zip(self.recordings, self.simulate(theta), strict=True):
            for row, (name, measured) in enumerate(zip(SIGNALS, (recording.position_mm, recording.torque_a), strict=True)):
                parts.append(np.nan_to_num((run.outputs[name] - measured) / recording.sigma[row]))
        return np.concatenate(parts, axis=1)

    def blocks(self) -> NDArray[np.intp]:
        """Number of the time block that each residual belongs to; position and torque of a moment share one."""
        parts, first = [], 0
        for recording in self.recordings:
            block = ((recording.t_s - recording.t_s[0]) // BLOCK_S).astype(np.intp) + first
            parts += [block, block]
            first = int(block[-1]) + 1
        return np.concatenate(parts)


@dataclass(frozen=True, slots=True, eq=False)
class AxisFit:
    """Where the fit ended.

    theta: (p,); covariance: (p, p); information: (p,) part of it that comes from the recordings; evaluations: simulated candidates
    """

    model: AxisModel
    theta: Floats
    covariance: Floats
    information: Floats
    evaluations: int


def fit_axis(model: AxisModel, progress: Callable[[], None] = lambda: None) -> AxisFit:
    """Fits all parameters together. Raises nothing of its own: a poor fit shows in its residuals."""
    sigma = np.array([p.sigma for p in model.parameters])
    step = 1e-4
    evaluations = 0

    def residuals(theta: Floats) -> Floats:
        nonlocal evaluations
        evaluations += 1
        progress()
        return np.concatenate([model.residuals(theta[None, :])[0], theta / sigma])

    def jacobian(theta: Floats) -> Floats:
        nonlocal evaluations
        evaluations += 2 * len(theta)
        moves = step * np.eye(len(theta))
        both = model.residuals(np.concatenate([theta + moves, theta - moves]))
        slope = (both[: len(theta)] - both[len(theta) :]).T / (2 * step)
        return np.concatenate([slope, np.diag(1.0 / sigma)])

    limit = np.array([1.5 if p.relative else min(0.9, 10.0 * p.sigma) for p in model.parameters])
    found = least_squares(
        residuals, np.zeros(len(sigma)), jacobian, bounds=(-limit, limit), loss="soft_l1", f_scale=3.0, xtol=1e-9
    )
    precision = np.diag(1.0 / sigma**2)
    # the weights of the robust loss at the solution: what is far off counts less, in the interval as in the fit
    weight = (1.0 + (found.fun / 3.0) ** 2) ** -0.25
    data = slice(0, len(found.fun) - len(sigma))
    raw = jacobian(found.x)
    covariance = clustered_covariance((raw * weight[:, None])[data], (found.fun * weight)[data], model.blocks(), precision)
    information = 1.0 - np.clip(np.diag(covariance) / sigma**2, 0.0, 1.0)
    return AxisFit(model, found.x, covariance, information, evaluations)


def noise_by_regime(regimes: NDArray[np.int8], noise: float, differences: Sequence[Floats]) -> Floats:
    """σ of each sample, (n,): the sensor's noise, or what repeated runs show in its regime where that is more.

    differences: of repeated runs of the same program, of the same length as `regimes`, or none
    """
    sigma = np.full(len(regimes), noise)
    for difference in differences:
        for regime in np.unique(regimes):
            here = regimes == regime
            sigma[here] = np.maximum(sigma[here], np.sqrt(np.nanmean(difference[here] ** 2) / 2.0))
    return sigma
