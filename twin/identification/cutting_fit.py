"""Identifies cutting coefficients and the spindle drive. Both are linear.

* On a dynamometer, F = K_t · f₁ + K_t K_e · f₂, with f₁ and f₂ the forces of the same cut at K_t = 1 and K_e = 0, and what K_e
  adds to them.
* On the load meter, load = 100 / (rated · η) · P_cut + 100 · idle / rated. Only these two combinations can be known; the rated
  power is what the meter's 100 % is called, so it stays, and η and the idle power are fitted. Without a dynamometer, K_t and η
  are one product, and η stays as well.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.identification.batch_fit import Fit, time_blocks
from twin.identification.estimate import KNOWN_MIN, clustered_covariance
from twin.machine import MachineFile, SpindleDrive, Tool
from twin.process.milling import Milling, MillingForce, milling_force, tool_constants
from twin.runlog import RunLog
from twin.simulator.recorded import told_of
from twin.simulator.response import milling_of
from twin.spindle.load import spindle_constants, spindle_load_pct

Floats = NDArray[np.float64]
BLOCK_S = 0.25


def linear_fit(regressors: Floats, measured: Floats, noise: float, prior: tuple[Floats, Floats], blocks: NDArray[np.intp]) -> Fit:
    """Weighted linear least squares with a Gaussian prior (mean, sigma), each (p,).

    A parameter that the samples tell less of than the prior stays at its mean, and the others are fitted once more beside it.

    regressors: (n, p); measured: (n,); noise: standard deviation of each sample
    """
    mean, sigma = prior
    rows = regressors / noise
    precision = np.diag(1.0 / sigma**2)
    theta = np.linalg.solve(rows.T @ rows + precision, rows.T @ (measured / noise) + precision @ mean)
    residuals = measured / noise - rows @ theta
    covariance = clustered_covariance(rows, residuals, blocks, precision)
    known = 1.0 - np.clip(np.diag(covariance) / sigma**2, 0.0, 1.0)
    free = known > KNOWN_MIN
    found = Fit(np.asarray(theta, dtype=np.float64), covariance, known, float(np.sqrt(np.mean(residuals**2))), 1)
    if free.all():
        return found
    held: Floats = np.array(mean, dtype=np.float64)
    covariance = np.diag(sigma**2)
    if free.any():
        left = measured - regressors[:, ~free] @ mean[~free]
        again = linear_fit(regressors[:, free], left, noise, (mean[free], sigma[free]), blocks)
        held[free], covariance[np.ix_(free, free)] = again.theta, again.covariance
    return replace(found, theta=held, covariance=covariance)


def fit_cutting(
    tool: Tool, cuts: Sequence[tuple[Milling, Floats, Floats, Floats]], period_s: float, noise_n: float, relative: float
) -> Fit:
    """(K_t, K_t K_e) from cuts: motion, time, force_x_n and force_y_n as recorded, each (ticks,), NaN = no sample."""
    rows, measured, blocks, first = [], [], [], 0
    for milling, t_s, force_x, force_y in cuts:
        unit: dict[str, ArrayLike] = {**tool_constants(tool), "tangential_coefficient_n_per_mm2": 1.0}
        unit["radial_ratio"] = np.array([0.0, 1.0])
        force = milling_force(unit, tool.teeth, milling, period_s=period_s)
        for modelled, recorded in ((force.force_x_n, force_x), (force.force_y_n, force_y)):
            here = np.isfinite(recorded) & (modelled[0] != 0.0)
            rows.append(np.stack([modelled[0, here], modelled[1, here] - modelled[0, here]], axis=1))
            measured.append(recorded[here])
            blocks.append(time_blocks(t_s, BLOCK_S)[here] + first)
        first += int(time_blocks(t_s, BLOCK_S)[-1]) + 1
    stated = tool.tangential_coefficient_n_per_mm2
    mean = np.array([stated, stated * tool.radial_ratio])
    prior = (mean, np.array([relative * mean[0], max(1.4 * relative * mean[1], 1e-3 * mean[0])]))
    return linear_fit(np.concatenate(rows), np.concatenate(measured), noise_n, prior, np.concatenate(blocks))


def force_of(machine: MachineFile, log: RunLog) -> MillingForce | None:
    """The cutting force of a recorded run by the machine's coefficients; None where nothing is cut."""
    milling = milling_of(told_of(log, machine)) if machine.tool else None
    if milling is None or machine.tool is None:
        return None
    return milling_force(tool_constants(machine.tool), machine.tool.teeth, milling, period_s=machine.machine.servo_period_s)


def with_cutting(tool: Tool, fitted: Fit) -> Tool:
    """The tool with the identified coefficients."""
    tangential, radial = (float(v) for v in fitted.theta)
    ratio = radial / tangential if fitted.known[1] > KNOWN_MIN else tool.radial_ratio
    return tool.model_copy(update={"tangential_coefficient_n_per_mm2": tangential, "radial_ratio": ratio})


def fit_spindle(
    spindle: SpindleDrive,
    runs: Sequence[tuple[Floats, Floats, Floats, Floats]],
    period_s: float,
    noise_pct: float,
    relative: float,
    efficiency_known: bool,
) -> Fit:
    """(1 / η, idle power in kW) from runs: time, cutting power in W, speed, and load as recorded, each (ticks,).

    efficiency_known: leave η as stated, because the cutting power itself is known only through it
    """
    rows, measured, blocks, first = [], [], [], 0
    bare = spindle_constants(spindle) | {"efficiency": 1.0, "idle_power_kw": 0.0}
    for t_s, power_w, rpm, load in runs:
        here = np.isfinite(load)
        cut = spindle_load_pct(bare, power_w, rpm, period_s=period_s)[0][here]
        rows.append(np.stack([cut, np.full(len(cut), 100.0 / spindle.rated_power_kw)], axis=1))
        measured.append(load[here])
        blocks.append(time_blocks(t_s, BLOCK_S)[here] + first)
        first += int(time_blocks(t_s, BLOCK_S)[-1]) + 1
    mean = np.array([1.0 / spindle.efficiency, spindle.idle_power_kw])
    sigma = np.array([relative * mean[0] if not efficiency_known else 1e-9, max(relative * mean[1], 1e-6)])
    return linear_fit(np.concatenate(rows), np.concatenate(measured), noise_pct, (mean, sigma), np.concatenate(blocks))


def with_spindle(spindle: SpindleDrive, fitted: Fit) -> SpindleDrive:
    """The drive with the identified efficiency and idle power."""
    efficiency = min(1.0, 1.0 / float(fitted.theta[0])) if fitted.known[0] > KNOWN_MIN else spindle.efficiency
    return spindle.model_copy(update={"efficiency": efficiency, "idle_power_kw": max(0.0, float(fitted.theta[1]))})
