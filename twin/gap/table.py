"""How far a twin is from a recording, signal by signal and regime by regime, beside what repeated runs differ by."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.case import Run
from twin.gap.labels import regime_labels
from twin.machine import MachineFile
from twin.runlog import AXIS_COLUMN, RunLog
from twin.simulator.recorded import noise_of, told_of
from twin.simulator.response import respond

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class GapRow:
    """One signal in one regime of one run.

    gap: rms of twin minus recording; repeatability: rms of the difference of repeated runs over √2, None where none were repeated
    in this regime; expected: what the twin itself predicts, noise of the sensor and spread of its courses; in the unit of the
    signal. Two runs with a few stops in them can agree by luck, so the repeatability of a pair may be below what is expected.
    """

    run: str
    signal: str
    regime: str
    samples: int
    gap: float
    repeatability: float | None
    expected: float

    @property
    def ratio(self) -> float | None:
        """Gap over repeatability."""
        return self.gap / self.repeatability if self.repeatability else None


def measured_signals(log: RunLog) -> tuple[str, ...]:
    """Columns that a machine answers with, where the run has samples of them."""
    names = [c for c in log.columns if (m := AXIS_COLUMN.match(c)) and m[2] != "ref_mm"]
    names += ["force_x_n", "force_y_n", "spindle_load_pct", "spindle_temp_c"]
    return tuple(name for name in names if log.has(name))


def regimes_of(log: RunLog, signal: str, machine: MachineFile) -> tuple[tuple[str, NDArray[np.bool_]], ...]:
    """Regimes in which a signal is looked at (`twin.gap.labels`), each with its samples (n,)."""
    names, label = regime_labels(log, signal, machine)
    return tuple((name, label == number) for number, name in enumerate(names))


def gap_table(machine: MachineFile, runs: Iterable[Run], repeats: Iterable[tuple[Run, Run]]) -> tuple[GapRow, ...]:
    """The gap of `machine` on each run, by signal and regime; repeatability from the repeated runs, pooled over all of them."""
    floors = _floors(machine, repeats)
    rows = []
    for run in runs:
        log = run.log
        recorded = {"spindle_load_pct": log["spindle_load_pct"]} if log.has("spindle_load_pct") and not log.axes() else None
        response = respond(machine, told_of(log, machine), recorded=recorded)
        for signal in measured_signals(log):
            if signal not in response.columns or (recorded and signal in recorded):
                continue
            error = response.columns[signal] - log[signal]
            for regime, here in regimes_of(log, signal, machine):
                there = here & np.isfinite(error)
                if there.any():
                    gap = float(np.sqrt(np.mean(error[there] ** 2)))
                    spread = response.spread[signal][there] if signal in response.spread else np.zeros(1)
                    expected = float(np.sqrt(noise_of(machine, log, signal) ** 2 + np.mean(spread**2)))
                    rows.append(GapRow(run.name, signal, regime, int(there.sum()), gap, floors.get((signal, regime)), expected))
    return tuple(rows)


def _floors(machine: MachineFile, repeats: Iterable[tuple[Run, Run]]) -> dict[tuple[str, str], float]:
    """(signal, regime) → repeatability."""
    squares: dict[tuple[str, str], list[Floats]] = {}
    for one, other in repeats:
        if len(one.log) != len(other.log):
            continue
        for signal in measured_signals(one.log):
            if not other.log.has(signal):
                continue
            difference = one.log[signal] - other.log[signal]
            for regime, here in regimes_of(one.log, signal, machine):
                kept = difference[here & np.isfinite(difference)]
                if len(kept):
                    squares.setdefault((signal, regime), []).append(kept**2 / 2.0)
    return {key: float(np.sqrt(np.mean(np.concatenate(parts)))) for key, parts in squares.items()}
