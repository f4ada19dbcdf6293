"""The floor under every gap: the difference of runs of a machine when nothing has changed.

Repeatability comes from repeated runs of a program (rms of their difference over √2, by signal and regime), or from the laps of a
run that goes through the same motion again and again; it is never less than the noise of the sensor. Two runs with a few stops in
them can agree by luck, so the spread that the twin expects of its own courses (`twin.servo.disturbance`) counts as well.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from twin.case import Run
from twin.gap.dynamometer.turn_run import SPREAD
from twin.gap.labels import measured_signals, regimes_of
from twin.machine import MachineFile
from twin.runlog import AXIS_COLUMN, RunLog
from twin.simulator.recorded import noise_of

Floats = NDArray[np.float64]
LAP_SAMPLES_MIN = 200


@dataclass(frozen=True, slots=True)
class Floors:
    """By (signal, regime). repeated: rms, from repeated runs; expected: rms, from the twin's own courses"""

    machine: MachineFile
    repeated: Mapping[tuple[str, str], float]
    expected: Mapping[tuple[str, str], float] = field(default_factory=dict)

    def of(self, log: RunLog, signal: str) -> Floats:
        """The floor of each sample of a signal, (n,)."""
        if log.has(f"{signal}{SPREAD}"):  # mean turns bring their own
            return log[f"{signal}{SPREAD}"]
        noise = noise_of(self.machine, log, signal)
        floor = np.full(len(log), noise)
        for regime, here in regimes_of(log, signal, self.machine):
            known = [v for v in (self.repeated.get((signal, regime)), self.expected.get((signal, regime))) if v is not None]
            floor[here] = max([noise, *known])
        return floor


def repeatability(runs: Iterable[Run], repeats: Iterable[tuple[Run, Run]], machine: MachineFile) -> Floors:
    """The floors that the runs themselves show."""
    squares: dict[tuple[str, str], list[Floats]] = {}
    pairs = [(one.log, other.log, 0) for one, other in repeats if len(one.log) == len(other.log)]
    if not pairs:
        pairs = [(log, log, lag) for log in (run.log for run in runs) if (lag := lap_of(log))]
    for one, other, lag in pairs:
        for signal in measured_signals(one):
            if not other.has(signal):
                continue
            difference = one[signal][lag:] - other[signal][: len(other) - lag]
            for regime, here in regimes_of(one, signal, machine):
                kept = difference[here[lag:] & np.isfinite(difference)]
                if len(kept):
                    squares.setdefault((signal, regime), []).append(kept**2 / 2.0)
    return Floors(machine, {key: float(np.sqrt(np.mean(np.concatenate(parts)))) for key, parts in squares.items()})


def lap_of(log: RunLog) -> int:
    """Samples after which the references of all axes repeat, for at least a quarter of the run; 0 where they do not.

    >>> from twin.runlog import run_log
    >>> t_s = np.arange(3000) * 0.001
    >>> lap_of(run_log({"t_s": t_s, "x_ref_mm": np.sin(2 * np.pi * np.arange(3000) / 1000)}))
    1000
    """
    references = [v for name, v in log.columns.items() if (m := AXIS_COLUMN.match(name)) and m[2] == "ref_mm"]
    if not references or len(log) < 2 * LAP_SAMPLES_MIN:
        return 0
    moving = max(references, key=lambda r: float(np.nanstd(r)))
    values = moving - np.nanmean(moving)
    size = float(np.std(values))
    if not np.isfinite(values).all() or size == 0.0:
        return 0
    spectrum = np.fft.rfft(values, 2 * len(values))
    together = np.fft.irfft(spectrum * np.conj(spectrum))[: len(values)]
    energy = np.concatenate([[0.0], np.cumsum(values**2)])
    lags = np.arange(LAP_SAMPLES_MIN, 3 * len(values) // 4)
    apart = energy[len(values) - lags] + energy[-1] - energy[lags] - 2.0 * together[lags]
    near = np.flatnonzero(apart / (len(values) - lags) < 1e-6 * size**2)
    lag = int(lags[near[0]]) if len(near) else 0
    if lag and all(np.sqrt(np.mean((r[lag:] - r[: len(r) - lag]) ** 2)) < 1e-3 * size for r in references):
        return lag
    return 0
