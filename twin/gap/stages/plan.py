"""The stages of a case, in the order of the sites, and what each needs of those before it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.case import Case, Run, RunKind
from twin.effects.catalogue import effect_named
from twin.gap.diagnosis import Effected, Verdict
from twin.gap.dynamometer.turn_run import TurnRun
from twin.gap.floors import Floors, repeatability
from twin.gap.naming.filtered import told_from_a_filter
from twin.gap.naming.of_the_air import unless_of_the_air
from twin.gap.naming.specific import only_specific
from twin.gap.naming.twins import with_twins
from twin.gap.null import NULL, Null
from twin.gap.search import Explained, bare_fit, explain, leaves_a_gap, without
from twin.gap.stages.air import AirStage, air_runs
from twin.gap.stages.axis import AxisStage, axis_constants_free, standing_of
from twin.gap.stages.axis_run import AxisRunData, axis_run_data, repeated_groups
from twin.gap.stages.cut import CutStage, cut_runs
from twin.gap.stages.disturbance import disturbance_of_repeats, expected_spread
from twin.gap.stages.healthy import with_healthy_floors
from twin.gap.stages.heat import HeatStage, heat_runs
from twin.gap.stages.open_loop.plan import open_stages
from twin.gap.stages.stage import Stage
from twin.gap.stages.tool_change import ToolChangeStage, change_runs
from twin.gap.stages.turns import TurnStage, turn_data
from twin.gap.verdict import judged
from twin.learned.standing import axis_terms
from twin.machine import MachineFile
from twin.runlog import RunLog
from twin.servo.disturbance import Disturbance
from twin.simulator.recorded import tool_of
from twin.simulator.response import disturbance_of
from twin.sites import Site

Floats = NDArray[np.float64]
Progress = Callable[[str], None]
SideBySide = Callable[[Callable[[Stage], Explained], Iterable[Stage]], Iterable[Explained]]
"""As `map`."""
FAR = 60.0
"""Gap of a closed loop, in floors, above which its controller is looked at first."""
AXES_TO_COMPARE = 2
"""Axes from which on a clock that all share can be told from a delay of one."""


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """The ground that all stages of a case stand on.

    machine: with the disturbance in its [noise]; has_programs: runs with their programs say how long a tool change takes
    """

    machine: MachineFile
    runs: tuple[Run, ...]
    repeats: tuple[tuple[Run, Run], ...]
    floors: Floors
    disturbance: Disturbance | None
    left_out: frozenset[str]
    has_programs: bool = False


def ground_of(case: Case, left_out: frozenset[str]) -> Ground:
    """Floors and disturbance of a case: from its repeated runs, without them as the machine states the disturbance."""
    machine = case.machine
    recorded = tuple(run for run in case.runs if run.entry.kind is not RunKind.PROGRAM)
    # mean turns bring their own floor
    by_run = tuple(run for run in recorded if not isinstance(run, TurnRun))
    pairs = tuple(pair for pair in case.repeats() if not any(isinstance(run, TurnRun) for run in pair))
    floors = repeatability(by_run, pairs, machine) if by_run else Floors(machine, {})
    floors = with_healthy_floors(floors, machine, by_run)
    # what was recorded while the twin was right says how well the machine repeats, and nothing of what is wrong now
    runs = tuple(run for run in recorded if not run.entry.healthy) or recorded
    seen: dict[str, tuple[str, RunLog, AxisRunData]] = {}
    for one in [one for one, _ in case.repeats()] or recorded:
        for letter in machine.axes:
            data = axis_run_data((one,), letter, floors, None, True)
            if letter not in seen and data is not None and data.told:
                seen[letter] = (letter, one.log, data)
    if case.repeats():
        disturbance, spread = disturbance_of_repeats(machine, list(seen.values()), floors)
    else:
        disturbance = disturbance_of(machine)
        spread = expected_spread(machine, list(seen.values()), disturbance) if disturbance else {}
    if disturbance is not None:
        noise = {"disturbance_force_n": disturbance.force_n, "disturbance_correlation_s": disturbance.correlation_s}
        machine = machine.model_copy(update={"noise": dict(machine.noise) | noise})
    has_programs = bool(case.of(RunKind.PROGRAM, "fit"))
    return Ground(machine, runs, case.repeats(), replace(floors, expected=spread), disturbance, left_out, has_programs)


def explained_stages(ground: Ground, progress: Progress, side_by_side: SideBySide = map, null: Null = NULL) -> list[Explained]:
    """Each stage explained: cut and spindle first, since its force pushes the axes; then axes and heat, side by side."""
    found: list[Explained] = []
    forces: dict[str, dict[str, Floats]] = {}
    for tool in dict.fromkeys(tool_of(run.log, ground.machine) for run in ground.runs):
        machine = ground.machine.with_tool(tool)
        runs = tuple(run for run in ground.runs if tool_of(run.log, ground.machine) == tool)
        cuts = cut_runs(machine, runs)
        if any(run.fitted for run in cuts):
            stage = CutStage(machine, cuts, ground.floors, ground.left_out, tool)
            if stage.candidates:
                found.append(explain(stage, null=null, progress=progress))
                forces |= _pushes(stage, found[-1])
        turning = turn_data(runs)
        if any(run.fitted for run in turning):
            turns = TurnStage(machine, turning, ground.left_out, tool)
            whole = told_from_a_filter(turns, explain(turns, null=null, progress=progress, doubtful=True), null)
            found.append(only_specific(turns, whole))
    stages: list[Stage] = [s for letter in ground.machine.axes if (s := axis_stage(ground, letter, forces)) is not None]
    in_air = air_runs(ground.machine, ground.runs)
    if any(run.fitted for run in in_air):
        stages.append(AirStage(ground.machine, in_air, ground.floors, ground.left_out))
    changes = () if ground.has_programs else change_runs(ground.machine, ground.runs)
    if any(run.fitted for run in changes):
        stages.append(ToolChangeStage(ground.machine, changes, ground.left_out))
    warmups = heat_runs(ground.machine, tuple(r for r in ground.runs if not r.log.axes()))
    if any(run.fitted for run in warmups):
        stages.append(HeatStage(ground.machine, warmups, ground.floors, ground.left_out))
    found += side_by_side(lambda stage: _explained(stage, ground, null, progress), stages)
    return with_one_clock(found, progress, null)


def _explained(stage: Stage, ground: Ground, null: Null, progress: Progress) -> Explained:
    """The stage explained; a closed loop that is off by orders of magnitude only where its controller is understood."""
    if isinstance(stage, AxisStage):
        base = bare_fit(stage)
        if base.left.gap() > FAR:
            loops = open_stages(stage, ground.runs, ground.repeats, ground.floors)
            controller = next((loop for loop in loops if loop.loop.name == "controller"), None)
            if controller is not None:
                alone = explain(controller, null=null, progress=progress)
                if judged(alone).verdict is Verdict.UNKNOWN:
                    return Explained(stage, base, base, (), {}, {})
                return explain(stage, null=null, progress=progress, known=alone.best)
    found = explain(stage, null=null, progress=progress)
    if isinstance(stage, AirStage) and found.best.effects and not leaves_a_gap(stage, found.base):
        return without(found)  # a few readings in whole percents always lean to one side
    if isinstance(stage, HeatStage):
        found = unless_of_the_air(stage, found)
    return with_twins(stage, found) if isinstance(stage, AirStage | HeatStage) else found


def with_one_clock(found: list[Explained], progress: Progress, null: Null) -> list[Explained]:
    """A clock is one for all axes: where some that move show it and others do not, it is not the clock, and they are asked again.

    Where all do, a delay of the command that each of them could have instead would be a coincidence.
    """
    axes = [e for e in found if isinstance(e.stage, AxisStage)]
    showing = [e for e in axes if any(_is_clock(effected) for effected in e.best.effects)]
    if len(axes) < AXES_TO_COMPARE or len(showing) == len(axes):
        return found
    settled = []
    for first in found:
        stage, answer = first.stage, first
        if first in showing and isinstance(stage, AxisStage):
            clocks = {effected.effect for effected in stage.candidates if _is_clock(effected)}
            answer = explain(replace(stage, left_out=stage.left_out | clocks), null=null, progress=progress)
        rivals = {e: tuple(r for r in others if not _is_clock(r)) for e, others in answer.rivals.items()}
        settled.append(replace(answer, rivals=rivals))
    return settled


def _is_clock(effected: Effected) -> bool:
    return effect_named(effected.effect).site is Site.CLOCK


def axis_stage(ground: Ground, letter: str, forces: dict[str, dict[str, Floats]]) -> AxisStage | None:
    """The stage of an axis; None where no run to be fitted moves it."""
    return _axis_stage(ground, letter, forces, told=True)


def unheard_axes(ground: Ground) -> tuple[AxisStage, ...]:
    """The axes whose reference no run to be fitted records, and whose motion it does: there the measured one stands for it."""
    found = (_axis_stage(ground, letter, {}, told=False) for letter in ground.machine.axes)
    return tuple(stage for stage in found if stage is not None)


def _axis_stage(ground: Ground, letter: str, forces: dict[str, dict[str, Floats]], *, told: bool) -> AxisStage | None:
    machine = ground.machine
    data = []
    for role in ("fit", "check"):
        for group in repeated_groups(tuple(r for r in ground.runs if r.entry.role == role), ground.repeats):
            push = forces.get(group[0].name, {}).get(letter)
            data.append(axis_run_data(group, letter, ground.floors, push, role == "fit"))
    known = tuple(d for d in data if d is not None and d.told is told)
    if not any(d.fitted for d in known):
        return None
    standing = standing_of(machine, letter)
    return AxisStage(
        letter,
        machine.axes[letter],
        machine.machine.servo_period_s,
        known,
        axis_constants_free(machine, letter),
        ground.disturbance,
        ground.left_out,
        standing,
        terms=axis_terms(machine.learned, letter),
    )


def _pushes(stage: CutStage, found: Explained) -> dict[str, dict[str, Floats]]:
    """run → axis → the force of the cut that resists its motion in +: by what the stage has found, or where that explains the cut
    badly, as the dynamometer recorded it, so that what is left lies downstream."""
    pushes: dict[str, dict[str, Floats]] = {}
    badly = judged(found).verdict in (Verdict.UNKNOWN, Verdict.PARTLY)
    for run in stage.runs:
        if badly and run.log.has("force_x_n", "force_y_n"):
            pushes[run.name] = {a: -np.nan_to_num(run.log[f"force_{a}_n"]) for a in "xy"}
            continue
        force = stage.force(found.best.model, found.best.theta[None, :], run)
        if force is not None:
            pushes[run.name] = {"x": -np.asarray(force.mean_force_x_n)[0], "y": -np.asarray(force.mean_force_y_n)[0]}
    return pushes
