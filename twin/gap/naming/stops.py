"""The torque that an axis stops with: what friction, a brake or a counterbalance hold it by, beside the twin's.

A long rest is no evidence by itself, since the integrator creeps on an error that is below the resolution of the scale. The first
moments of it are: there the torque is what the axis slid with, the same each time that it comes to rest so. A difference of a few
hundredths of an ampere in a few stops is little in the mean over a recording, and far beyond chance in each of them.
"""

import numpy as np
from numpy.typing import NDArray

from twin.gap.fitting import Fitted
from twin.gap.stages.axis import AxisStage
from twin.gap.stages.stage import Stage

Floats = NDArray[np.float64]
TORQUE = "torque_a"
AT_STOP_S = 0.05
"""Time at the end of a stretch of motion, which goes 0.2 s into the rest, over which the torque is averaged."""
SPREAD = 0.5
"""Standard deviation of such a mean on a healthy machine, in floors of the torque where it repeats best."""
WORST, BEYOND = 2, 3.0
"""Stops that may be chance, and the rms of all others, in standard deviations, from which on they are not."""


def stops_are_at_odds(stage: Stage, found: Fitted) -> bool:
    """Return True where an axis stops with another torque than the twin, again and again."""
    if not isinstance(stage, AxisStage) or TORQUE not in stage.outputs:
        return False
    pushed = any(run.disturbance_n is not None and run.disturbance_n.any() for run in stage.runs)
    away = np.concatenate([_at_stops(stage, found, number) for number in range(len(stage.runs))])
    if pushed or len(away) <= 2 * WORST:
        return False
    kept = np.sort(np.abs(away))[:-WORST]
    return bool(np.sqrt(np.mean(kept**2)) > BEYOND)


def _at_stops(stage: AxisStage, found: Fitted, number: int) -> Floats:
    """Return the torque at each stop of a run, measured minus the twin's, in standard deviations."""
    run = stage.runs[number]
    shown = stage.simulate(found.model, found.theta[None, :], run)[TORQUE][0]
    count = max(1, round(AT_STOP_S / stage.period_s))
    measured, least = run.measured[TORQUE], SPREAD * float(np.nanmin(run.floor[TORQUE]))
    away, end = [], 0
    for stretch in run.stretches():
        end += stretch.stop - stretch.start
        if np.ptp(run.reference_mm[max(stretch.stop - count - 1, 0) : stretch.stop]) > 0.0:
            continue  # the recording ends while the axis moves
        known = measured[stretch.stop - count : stretch.stop]
        away.append((np.mean(known) - np.mean(shown[end - count : end])) / least)
    return np.asarray([a for a in away if np.isfinite(a)])
