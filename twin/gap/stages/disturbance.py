"""The size and slowness of a machine's disturbance, from how far its repeated runs differ.

For each candidate (σ, τ) the axes are simulated over many courses; the spread that they have in each regime is compared with what
the repeated runs differ by there, as a Gaussian log-likelihood over the cells. Differences of repeated runs know nothing of the
gap itself, so this can come before anything is explained.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from twin.gap.floors import Floors
from twin.gap.labels import regimes_of
from twin.gap.stages.axis import LANES, axis_effects
from twin.gap.stages.axis_run import OUTPUTS, AxisRunData
from twin.machine import MachineFile
from twin.runlog import RunLog
from twin.servo.constants import axis_constants
from twin.servo.disturbance import CORRELATIONS_S, Disturbance
from twin.servo.run import AxisInput, run_axes
from twin.simulator.recorded import noise_of, start_of

Floats = NDArray[np.float64]
Spread = Mapping[tuple[str, str], float]
FORCES_N = (0.3, 0.6, 1.2, 2.4, 4.8)
TICKS_MAX = 30_000


def disturbance_of_repeats(
    machine: MachineFile, axes: Sequence[tuple[str, RunLog, AxisRunData]], floors: Floors
) -> tuple[Disturbance | None, Spread]:
    """The likeliest disturbance, and the spread that it gives each (signal, regime), the sensor's noise included.

    axes: letter, its recording, and what is known of the force on it. None where no runs were repeated.
    """
    if not floors.repeated or not axes:
        return None, {}
    scored = []
    for candidate in (None, *(Disturbance(f, c) for f in FORCES_N for c in CORRELATIONS_S)):
        spread = expected_spread(machine, axes, candidate)
        cells = [(floors.repeated[key], expected) for key, expected in spread.items() if key in floors.repeated]
        likelihood = -sum(np.log(expected**2) + (repeated / expected) ** 2 for repeated, expected in cells) / 2.0
        scored.append((float(likelihood), candidate, spread))
    _, best, spread = max(scored, key=lambda s: s[0])
    return best, spread


def expected_spread(
    machine: MachineFile, axes: Sequence[tuple[str, RunLog, AxisRunData]], disturbance: Disturbance | None
) -> dict[tuple[str, str], float]:
    """(signal, regime) → rms of the courses about their mean, with the sensor's noise."""
    spread: dict[tuple[str, str], float] = {}
    for number, (letter, log, data) in enumerate(axes):
        variances = _variances(machine, letter, log, data, disturbance, number)
        for column, output in OUTPUTS.items():
            signal = f"{letter}_{column}"
            if not log.has(signal):
                continue
            noise = noise_of(machine, log, signal)
            for regime, here in regimes_of(log, signal, machine):
                where = here[: len(variances[output])]
                if where.any():
                    spread[signal, regime] = float(np.sqrt(noise**2 + np.mean(variances[output][where])))
    return spread


def _variances(
    machine: MachineFile, letter: str, log: RunLog, data: AxisRunData, disturbance: Disturbance | None, number: int
) -> dict[str, Floats]:
    ticks = min(len(log), TICKS_MAX)
    if disturbance is None:
        return {output: np.zeros(ticks) for output in OUTPUTS.values()}
    axis, period_s = machine.axes[letter], machine.machine.servo_period_s
    constants = {name: np.full(LANES, value) for name, value in axis_constants(axis).items()}
    if axis.screw_lead_mm is None:
        constants["screw_lead_mm"] = np.ones(LANES)
    for effect in axis_effects():
        constants |= {f"{effect.name}__{key}": np.full(LANES, value) for key, value in effect.null_values().items()}
    force = disturbance.courses(LANES, ticks, period_s, [7, number])
    if data.disturbance_n is not None:
        force = force + data.disturbance_n[:ticks]
    run = run_axes(
        constants,
        AxisInput(np.broadcast_to(data.reference_mm[:ticks], (LANES, ticks)), np.arange(LANES), force),
        period_s=period_s,
        effects=tuple(e.name for e in axis_effects()),
        outputs=tuple(OUTPUTS.values()),
        start=start_of(log, letter, axis, period_s),
    )
    return {output: run.outputs[output].var(axis=0) for output in OUTPUTS.values()}
