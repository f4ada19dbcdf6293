"""The gap of a twin that runs freely over a recording, by run, signal and regime, beside what repeated runs differ by.

The twin is told what the machine was told and never put back to what was measured, so this is how far a simulation of the whole
run ends up from it, and where an axis comes to rest counts. `twin.gap.score` is the other gap: there the twin starts each stretch
of motion from what was measured, and only what it does within the stretch counts. Both look at the same signals, in the same
regimes (`twin.gap.labels`), over the same repeatability (`twin.gap.floors`).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from twin.case import Run
from twin.gap.floors import repeatability
from twin.gap.labels import measured_signals, regimes_of
from twin.machine import MachineFile
from twin.simulator.recorded import noise_of, told_of
from twin.simulator.response import respond


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


def free_run_gap(machine: MachineFile, runs: Iterable[Run], repeats: Iterable[tuple[Run, Run]]) -> tuple[GapRow, ...]:
    """Return the gap of `machine` on each run, by signal and regime; repeatability is pooled over all repeated runs."""
    floors = repeatability((), repeats, machine).repeated
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
