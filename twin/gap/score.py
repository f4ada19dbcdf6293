"""The gap of a twin on recorded runs: rms of twin minus recording over what repeated runs differ by, by signal and of all.

The twin is compared stretch by stretch (`twin.gap.stages.shown`), each from what was measured before it; `twin.gap.free_run`
simulates the whole run.

Regimes of a signal repeat differently well (a torque at constant speed ten times better than at a reversal), so each sample
counts by its own floor:

    gap / floor = √(mean (error / floor)²),   floor = √(n / Σ 1 / floor²),   gap = √(Σ (error / floor)² / Σ 1 / floor²)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.case import Run
from twin.gap.diagnosis import Trace
from twin.gap.floors import Floors
from twin.gap.labels import measured_signals, regime_labels
from twin.gap.units import unit_of

Floats = NDArray[np.float64]
BLOCK_S = 0.5
BLOCKS_MAX = 400


@dataclass(frozen=True, slots=True, eq=False)
class Squares:
    """A signal over its runs, by time block, (blocks,) each: sums of (error / floor)² and of 1 / floor², and samples."""

    ratio: Floats
    weight: Floats
    count: Floats

    def over_floor(self) -> float:
        """Rms of the error in floors."""
        return float(np.sqrt(self.ratio.sum() / max(self.count.sum(), 1.0)))

    def floor(self) -> float:
        """Floor of the signal, in its unit."""
        return float(np.sqrt(self.count.sum() / max(self.weight.sum(), 1e-300)))

    def rms(self) -> float:
        """Rms of the error, in the unit of the signal."""
        return self.over_floor() * self.floor()


def squares_of(runs: Sequence[Run], shown: Mapping[str, Mapping[str, Floats]], floors: Floors) -> dict[str, Squares]:
    """signal → squares; shown: run → column → (n,) of the twin."""
    parts: dict[str, list[tuple[Floats, Floats, Floats]]] = {}
    for run in runs:
        log = run.log
        for signal in measured_signals(log):
            twin = shown[run.name].get(signal)
            if twin is None:
                continue
            error, floor = twin - log[signal], floors.of(log, signal)
            there = np.isfinite(error)
            span = float(log.t_s[-1] - log.t_s[0]) if len(log) > 1 else 0.0
            block = ((log.t_s - log.t_s[0]) / max(BLOCK_S, span / BLOCKS_MAX)).astype(np.intp)[there]
            if len(block):
                inverse = 1.0 / floor[there] ** 2
                ratio, weight = (np.bincount(block, weights=w).astype(np.float64) for w in (error[there] ** 2 * inverse, inverse))
                parts.setdefault(signal, []).append((ratio, weight, np.bincount(block).astype(np.float64)))
    return {s: Squares(*(np.concatenate([p[k] for p in found]) for k in range(3))) for s, found in parts.items()}


def gap_of(squares: Mapping[str, Squares]) -> float:
    """Rms over the floor of all signals, each counted alike."""
    ratios = [s.over_floor() for s in squares.values()]
    return float(np.sqrt(np.mean(np.square(ratios)))) if ratios else 0.0


def traces_of(
    runs: Sequence[Run], before: Mapping[str, Mapping[str, Floats]], after: Mapping[str, Mapping[str, Floats]], floors: Floors
) -> tuple[Trace, ...]:
    """Each signal of each run beside its twins."""
    traces = []
    for run in runs:
        log = run.log
        for signal in measured_signals(log):
            if signal not in before[run.name]:
                continue
            names, label = regime_labels(log, signal, floors.machine)
            one, other = before[run.name][signal], after[run.name][signal]
            fitted = run.entry.role == "fit"
            floor = floors.of(log, signal)
            traces.append(Trace(run.name, signal, unit_of(signal), log.t_s, log[signal], one, other, floor, label, names, fitted))
    return tuple(traces)
