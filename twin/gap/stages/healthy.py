"""The floors that healthy runs give: what the twin left of heat and load while it was known to be right.

No two days of production are alike, so none repeats another. A day on which nothing was wrong says as much: what the twin with
its constants refitted leaves of it is air that is warmer elsewhere, grease that is stiff in the morning, and no gap.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twin.case import Run
from twin.gap.floors import Floors
from twin.gap.labels import regime_labels
from twin.gap.search import bare_fit
from twin.gap.stages.air import AirStage, air_runs
from twin.gap.stages.heat import HeatStage, heat_runs
from twin.machine import MachineFile


def with_healthy_floors(floors: Floors, machine: MachineFile, runs: Sequence[Run]) -> Floors:
    """Return the floors, of heat and load in air not below what the twin leaves of the healthy ones of these runs."""
    healthy = tuple(run for run in runs if run.entry.healthy and not run.log.axes())
    stages: list[HeatStage | AirStage] = []
    if warm := tuple(replace(run, fitted=True) for run in heat_runs(machine, healthy)):
        stages.append(HeatStage(machine, warm, floors))
    if idle := tuple(replace(run, fitted=True) for run in air_runs(machine, healthy)):
        stages.append(AirStage(machine, idle, floors))
    known = dict(floors.repeated)
    for stage in stages:
        left = bare_fit(stage).left_fit
        for signal, rms in zip(left.signals, left.rms(), strict=True):
            floor = float(rms) * float(np.median(np.concatenate([o.floor for o in stage.observed])))
            for regime in regime_labels(stage.runs[0].log, signal, machine)[0]:
                known[signal, regime] = max(known.get((signal, regime), 0.0), floor)
    return replace(floors, repeated=known)
