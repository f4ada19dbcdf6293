"""The open loops of an axis of a case: those whose inputs and answer were recorded, with the floors of each."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.case import Run
from twin.gap.floors import Floors
from twin.gap.stages.axis import AxisStage
from twin.gap.stages.axis_run import AxisRunData, axis_run_data
from twin.gap.stages.open_loop.controller import Controller
from twin.gap.stages.open_loop.loop import Loop, places
from twin.gap.stages.open_loop.mechanics import Mechanics
from twin.gap.stages.open_loop.repeats import loop_floors
from twin.gap.stages.open_loop.stage import OpenStage, alone
from twin.gap.stages.open_loop.table import Table
from twin.gap.stages.smoothed import sample_period_s
from twin.gap.stages.stage import Model

Floats = NDArray[np.float64]
ON_TOP_OF = {"mechanics": "torque_a", "table": "pos_mm"}
"""Loop → measured column, without the letter, that its answer is to be added to."""
SAMPLE_S_MAX = 0.02
"""Sample period above which what happened between samples is not known."""
KNOWN_MIN = 0.8
"""Part of the samples of a run's motion that have to be there."""


def loops_of(data: AxisRunData) -> tuple[Loop, ...]:
    """Return the loops whose inputs and answer a run recorded."""
    moved = "pos_mm" in data.measured and _whole(data)
    found: list[Loop] = []
    if moved and "torque_a" in data.measured:
        found += [Controller(), Mechanics()] if data.told else [Mechanics()]
    if moved and "table_mm" in data.measured:
        found.append(Table(("pos_mm", "torque_a") if "torque_a" in data.measured else ("pos_mm",)))
    return tuple(found)


def open_stages(
    closed: AxisStage, runs: Sequence[Run], repeats: Sequence[tuple[Run, Run]], floors: Floors
) -> tuple[OpenStage, ...]:
    """Return the open loops of an axis, in the order of the sites."""
    by_name = {data.name: data for data in closed.runs}
    singles, pushed = list[tuple[Run, AxisRunData]](), dict[str, AxisRunData]()
    for run in runs:
        known = next((by_name[name] for name in _same_program(run, repeats) if name in by_name), None)
        data = None if known is None else axis_run_data((run,), closed.letter, floors, known.disturbance_n, known.fitted)
        if data is not None:
            singles.append((run, data))
            pushed[run.name] = data
    if not singles or not all(loops_of(data) == loops_of(closed.runs[0]) for _, data in singles):
        return ()
    names = [run.name for run, _ in singles]
    pairs = [(names.index(a.name), names.index(b.name)) for a, b in repeats if {a.name, b.name} <= set(names)]
    pairs = [(a, b) for a, b in pairs if len(singles[a][1].t_s) == len(singles[b][1].t_s)]
    return tuple(
        OpenStage.of(closed, loop, loop_floors(floors.machine, alone(closed, loop), loop, singles, pairs))
        for loop in loops_of(closed.runs[0])
    )


def open_columns(axis: AxisStage, model: Model, theta: Floats, data: AxisRunData) -> dict[str, Floats]:
    """Return column → (n,) of the twin where its open loops are compared: what was measured, and what the twin makes of it.

    The torque is the one that the measured motion takes; the position of the motor is given.
    """
    columns = {}
    for loop in loops_of(data):
        if loop.name in ON_TOP_OF:
            column = np.full(len(data.t_s), np.nan)
            where = places(data)
            answer = loop.answer(alone(axis, loop), model, theta, data)[0]
            column[where] = data.measured[ON_TOP_OF[loop.name]][where] + answer
            columns[f"{axis.letter}_{loop.compared}"] = column
    return columns


def _same_program(run: Run, repeats: Sequence[tuple[Run, Run]]) -> tuple[str, ...]:
    """Names of the run and of those that it repeats."""
    others = [one.name if other.name == run.name else other.name for one, other in repeats if run.name in (one.name, other.name)]
    return (run.name, *others)


def _whole(data: AxisRunData) -> bool:
    """Return True where the position was sampled often enough, and nearly everywhere."""
    position = data.measured["pos_mm"]
    sample_s = sample_period_s(position, data.period_s)
    if not sample_s <= SAMPLE_S_MAX:
        return False
    there = np.isfinite(position[places(data)])
    return bool(len(there)) and float(there.mean()) * sample_s / data.period_s >= KNOWN_MIN
