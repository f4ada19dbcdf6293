"""Identifies an axis: the closed loop is simulated from the reference alone, and its constants are fitted to position and torque.

Fitting the loop, not the force balance, needs no acceleration, which a recording does not have; the start is the stated machine,
whose constants are a few percent off. The noise is that of each signal by regime: at rest, sticking makes the torque repeat
worse than its sensor, so those samples count less.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.identification.axis_parameters import AxisParameter, constants_at, effects_of
from twin.identification.batch_fit import Fit, fit, time_blocks
from twin.machine import Axis
from twin.regimes import axis_regimes, motion_stretches
from twin.servo.constants import axis_constants
from twin.servo.run import AxisInput, AxisRun, run_axes
from twin.simulator.recorded import start_state

Floats = NDArray[np.float64]
BLOCK_S = 1.0
MISFIT = 2.0
"""Residuals of twice the noise are more than noise."""
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

    def cut(self, where: slice, widened: Floats | None = None) -> "AxisRecording":
        """A stretch of it; `widened`: (2,) factors on the noise."""
        sigma = self.sigma[:, where] if widened is None else self.sigma[:, where] * widened[:, None]
        disturbance = None if self.disturbance_n is None else self.disturbance_n[where]
        series = (self.t_s[where], self.reference_mm[where], self.position_mm[where], self.torque_a[where])
        return AxisRecording(*series, disturbance, sigma)

    def regimes(self) -> NDArray[np.int8]:
        """Regime of each sample."""
        return axis_regimes(self.t_s, self.reference_mm)


def stretches(recording: AxisRecording) -> tuple[AxisRecording, ...]:
    """The stretches of motion, each with a little of the rest before and after it; the whole where the axis never rests.

    While an axis sticks, its integrator creeps on an error of tenths of a micrometre, so the torque from which it breaks away
    after a long rest is chance. Fitted through, that chance would be taken for friction; each stretch therefore starts from the
    torque that was measured (multiple shooting: Bock 1981; for servo axes, Janot, Gautier, Brunot 2019 start each lap again).
    """
    return tuple(recording.cut(where) for where in motion_stretches(recording.t_s, recording.reference_mm))


def start_of(recording: AxisRecording, axis: Axis, period_s: float) -> Mapping[str, float]:
    """The state at the first sample."""
    return start_state(axis, recording.reference_mm, recording.position_mm, recording.torque_a, period_s)


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
            runs.append(
                run_axes(
                    constants, inputs, period_s=self.period_s, outputs=SIGNALS, start=start, effects=effects_of(self.parameters)
                )
            )
        return runs

    def residuals(self, theta: Floats) -> Floats:
        """In units of the noise, (candidates, n), all runs and signals one after another."""
        parts = []
        for recording, run in zip(self.recordings, self.simulate(theta), strict=True):
            for row, (name, measured) in enumerate(zip(SIGNALS, (recording.position_mm, recording.torque_a), strict=True)):
                parts.append(np.nan_to_num((run.outputs[name] - measured) / recording.sigma[row]))
        return np.concatenate(parts, axis=1)

    def left_over(self, theta: Floats) -> Floats:
        """Root mean square of the residuals of position and of torque, (2,), in units of their noise."""
        squares, samples = np.zeros(2), 0
        for recording, run in zip(self.recordings, self.simulate(theta[None, :]), strict=True):
            for row, (name, measured) in enumerate(zip(SIGNALS, (recording.position_mm, recording.torque_a), strict=True)):
                squares[row] += np.nansum(((run.outputs[name][0] - measured) / recording.sigma[row]) ** 2)
            samples += len(recording.t_s)
        return np.sqrt(squares / samples)

    def blocks(self) -> NDArray[np.intp]:
        """Number of the time block that each residual belongs to; position and torque of a moment share one."""
        parts, first = [], 0
        for recording in self.recordings:
            block = time_blocks(recording.t_s, BLOCK_S) + first
            parts += [block, block]
            first = int(block[-1]) + 1
        return np.concatenate(parts)


@dataclass(frozen=True, slots=True, eq=False)
class AxisFit:
    """A fitted axis."""

    model: AxisModel
    found: Fit

    @property
    def theta(self) -> Floats:
        """Parameters, (p,)."""
        return self.found.theta


def fit_axis(model: AxisModel) -> AxisFit:
    """Fits all parameters of an axis together. A poor fit shows in its residuals.

    Where more is left than noise, the structure is not quite that of the axis, and what is left is the noise of a second fit:
    weighted by sensors that see nanometres, the residuals would decide by which of them happen to be smallest.
    """
    sigma = np.array([p.sigma for p in model.parameters])
    limit = np.array([1.5 if p.relative else min(0.9, 10.0 * p.sigma) for p in model.parameters])
    first = fit(model.residuals, sigma, limit, model.blocks())
    left = model.left_over(first.theta)
    if float(left.max()) < MISFIT:
        return AxisFit(model, first)
    widened = [r.cut(slice(None), widened=np.maximum(left, 1.0)) for r in model.recordings]
    model = AxisModel(model.axis, model.parameters, tuple(widened), model.period_s)
    return AxisFit(model, fit(model.residuals, sigma, limit, model.blocks(), first.theta))


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
