"""The floor of an open loop: what it leaves of two runs of a program differs by this much from run to run.

    residual = answer − recorded,   floor = rms (residual₁ − residual₂) / √2, by regime

What the model lacks is in both residuals and cancels. Blocks in which the laps of one run differ by far more than elsewhere, as
where somebody pushed the axis, count as gap and not as floor (`twin.gap.floors`). Where no run was repeated: the noise of the
sensors, sent through the loop, and the white and slow noise of the residual itself, from the median of its second differences
over a few correlation times, which rare events do not move.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin.case import Run
from twin.gap.floors import BLOCK_S, lap_of, without_events
from twin.gap.labels import AXIS
from twin.gap.stages.axis import AxisStage
from twin.gap.stages.axis_run import AxisRunData
from twin.gap.stages.open_loop.loop import ALIKE_S, Loop, places
from twin.gap.stages.stage import Model
from twin.machine import MachineFile
from twin.simulator.recorded import noise_of, white_noise

Floats = NDArray[np.float64]
ByRegime = Mapping[int, float]
APART_S = 3.0 * ALIKE_S
SAMPLES_MIN = 20
"""Samples of a regime below which its own floor is not known."""


def loop_floors(
    machine: MachineFile,
    axis: AxisStage,
    loop: Loop,
    singles: Sequence[tuple[Run, AxisRunData]],
    pairs: Sequence[tuple[int, int]],
) -> ByRegime:
    """Regime → floor, in the unit of what is compared; pairs: places in `singles` of runs of one program."""
    left = [_left(axis, loop, data) for _, data in singles]
    differences: list[tuple[Floats, NDArray[np.int8]]] = []
    for one, other in pairs:
        regimes = singles[one][1].regime
        differences.append(((left[one] - left[other]) / np.sqrt(2.0), regimes))
    if not differences:
        for (run, data), residual in zip(singles, left, strict=True):
            if lag := lap_of(run.log):
                differences.append(((residual[lag:] - residual[:-lag]) / np.sqrt(2.0), data.regime[lag:]))
    floors = _known(machine, axis, loop, *singles[0], left[0])
    if differences:
        block = max(1, round(BLOCK_S / singles[0][1].period_s))
        found = _by_regime(differences) if pairs else _by_regime(differences, block)
        return {regime: max(found.get(regime, floors[regime]), floors[regime]) for regime in floors}
    step = max(1, round(APART_S / singles[0][1].period_s))
    slow = max(white_noise(residual, step=step) for residual in left)
    return {regime: max(value, slow) for regime, value in floors.items()}


def _left(axis: AxisStage, loop: Loop, data: AxisRunData) -> Floats:
    """Answer of the machine as stated minus what was recorded, (n,), NaN between the stretches."""
    values = np.full(len(data.t_s), np.nan)
    where = places(data)
    values[where] = loop.answer(axis, Model((), ()), np.zeros((1, 0)), data)[0] - loop.recorded(data)
    return values


def _known(machine: MachineFile, axis: AxisStage, loop: Loop, run: Run, data: AxisRunData, left: Floats) -> dict[int, float]:
    """Regime → what white noise of the sensors and the timing of samples make of the residual; of all where one is rare."""
    draw = np.random.default_rng([13, ord(axis.letter[0])])
    sizes = {o: min(noise_of(machine, run.log, f"{axis.letter}_{o}"), white_noise(v, order=4)) for o, v in data.measured.items()}
    noisy = {output: v + sizes[output] * draw.standard_normal(len(v)) for output, v in data.measured.items()}
    where = places(data)
    by_timing = np.full(len(data.t_s), np.nan)
    by_timing[where] = loop.timing(axis, data)
    parts = [_left(axis, loop, replace(data, measured=noisy)) - left, by_timing]
    whole = float(np.sqrt(sum(_rms(part) ** 2 for part in parts)))
    own = [_by_regime([(part, data.regime)]) for part in parts]
    sizes_of = {regime: float(np.sqrt(sum(found[regime] ** 2 for found in own))) for regime in own[0]}
    return {regime: max(sizes_of.get(regime, whole), 1e-9) for regime in range(len(AXIS))}


def _by_regime(differences: Sequence[tuple[Floats, NDArray[np.int8]]], block: int = 0) -> dict[int, float]:
    """Return the rms in each regime. block: samples of which those that stand out are left out as events; 0 = none is"""
    found = {}
    for regime in range(len(AXIS)):
        parts = np.concatenate([values[label == regime] for values, label in differences])
        parts = parts[np.isfinite(parts)]
        if len(parts) >= SAMPLES_MIN:
            found[regime] = _rms_without_events(parts, block) if block else _rms(parts)
    return found


def _rms_without_events(values: Floats, block: int) -> float:
    starts = np.arange(0, len(values), block)
    count = np.diff([*starts, len(values)]).astype(np.float64)
    return without_events(np.add.reduceat(values**2, starts) / count, count)


def _rms(values: Floats) -> float:
    there = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(there**2))) if len(there) else 0.0
