"""A twin beside a recorded run, for judging it: the stages of the search, with the machine as it is and nothing free.

Each stretch of an axis' motion starts from what was measured before it: while an axis sticks, its integrator creeps on an error
below the sensor's resolution, so the torque of a long rest is chance, and where there is no motion nothing is compared (NaN).
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from twin.case import Run
from twin.effects.added import check_effects
from twin.effects.catalogue import effect_named
from twin.effects.effect import On
from twin.gap.diagnosis import Effected
from twin.gap.floors import Floors
from twin.gap.stages.air import AirStage, air_runs
from twin.gap.stages.axis import AxisStage, standing_of
from twin.gap.stages.axis_run import axis_run_data
from twin.gap.stages.cut import CutStage, cut_runs
from twin.gap.stages.free import effect_parameters
from twin.gap.stages.heat import HeatStage, heat_runs
from twin.gap.stages.open_loop.plan import open_columns
from twin.gap.stages.stage import Model
from twin.gap.stages.turns import TurnStage, turn_data
from twin.learned.standing import axis_terms
from twin.machine import MachineFile
from twin.simulator.recorded import tool_of
from twin.simulator.response import disturbance_of
from twin.sites import Site

Floats = NDArray[np.float64]
PAIRS = 16


def shown(machine: MachineFile, run: Run, floors: Floors) -> dict[str, Floats]:
    """Column → (n,) of the twin over a recorded run, NaN where it isn't compared.

    Raises EffectError where the machine's effects do not fit it.
    """
    check_effects(machine)
    columns: dict[str, Floats] = {}
    pushes: dict[str, Floats] = {}
    with_tool = machine.with_tool(tool_of(run.log, machine))
    for cut in cut_runs(with_tool, (run,)):
        stage = CutStage(with_tool, (cut,), floors)
        observed = stage.observed[0]
        model, theta = _sensing(machine, set(observed.signals).__contains__)
        predicted = np.where(np.isfinite(observed.measured), stage.predict(model, theta, 0)[0], np.nan)
        columns |= dict(zip(observed.signals, predicted.reshape(len(observed.signals), -1), strict=True))
        force = stage.force(model, theta, cut)
        if force is not None:
            pushes = {"x": -np.asarray(force.mean_force_x_n)[0], "y": -np.asarray(force.mean_force_y_n)[0]}
    for data in turn_data((run,)):
        turned = TurnStage(with_tool, (data,))
        columns |= turned.shown(*_sensing(machine, set(data.signals).__contains__), 0)
    for letter in machine.axes:
        columns |= _axis(machine, run, floors, letter, pushes.get(letter))
    for idling in air_runs(machine, (run,)):
        air = AirStage(machine, (idling,), floors)
        columns["spindle_load_pct"] = air.shown(*_sensing(machine, set(air.observed[0].signals).__contains__), 0)
    if not run.log.axes():
        for warming in heat_runs(machine, (run,)):
            heat = HeatStage(machine, (warming,), floors)
            model, theta = _sensing(machine, set(heat.observed[0].signals).__contains__)
            columns[heat.observed[0].signals[0]] = heat.shown(model, theta, 0)
    return columns


def _axis(machine: MachineFile, run: Run, floors: Floors, letter: str, push: Floats | None) -> dict[str, Floats]:
    data = axis_run_data((run,), letter, floors, push, fitted=False)
    if data is None:
        return {}
    standing = standing_of(machine, letter)
    period_s = machine.machine.servo_period_s
    terms = axis_terms(machine.learned, letter)
    stage = AxisStage(
        letter, machine.axes[letter], period_s, (data,), (), disturbance_of(machine), standing=standing, pairs=PAIRS, terms=terms
    )
    fixed = {name for name, _ in standing}
    model, theta = _sensing(machine, lambda on: on.startswith(f"{letter}_"), letter, fixed)
    if letter in floors.opened_axes:
        return open_columns(stage, model, theta, data)
    if not data.told:
        return {}
    observed = stage.observed[0]
    predicted = stage.predict(model, theta, 0)[0].reshape(len(observed.signals), -1)
    where = np.concatenate([np.arange(len(data.t_s))[s] for s in data.stretches()])
    columns = {}
    for signal, values in zip(observed.signals, predicted, strict=True):
        column = np.full(len(data.t_s), np.nan)
        column[where] = values
        columns[signal] = data.of_loops(column)
    if f"{letter}_table_mm" in columns and f"{letter}_pos_mm" in columns:
        columns[f"{letter}_table_mm"] += columns[f"{letter}_pos_mm"]
    return columns


def _sensing(
    machine: MachineFile, is_seen: Callable[[str], bool], letter: str = "", fixed: frozenset[str] | set[str] = frozenset()
) -> tuple[Model, Floats]:
    """The effects between what is and what is recorded, as a model with nothing free, and its θ, (1, p)."""
    effects, theta = [], list[float]()
    for added in machine.effects:
        effect = effect_named(added.effect)
        sensor = effect.on is On.SIGNAL and is_seen(added.on)
        timing = bool(letter) and (effect.site is Site.CLOCK or (added.on == letter and added.effect not in fixed))
        if sensor or timing:
            effects.append(Effected(added.effect, added.on))
            values = effect.checked(added.parameters)
            theta += [p.theta_of(values[p.name.partition("__")[2]]) for p in effect_parameters(effect)]
    return Model((), tuple(effects)), np.array([theta])


def shown_by_run(machine: MachineFile, runs: tuple[Run, ...], floors: Floors) -> Mapping[str, Mapping[str, Floats]]:
    """Return run → what the twin shows in it."""
    return {run.name: shown(machine, run, floors) for run in runs}
