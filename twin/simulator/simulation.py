"""The simulated machine: a part program in, what the machine would record out.

program → canonical moves (twin.programs) → path, look-ahead, reference (twin.motion) → engagement (twin.engagement) → response
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.assumed import assumed_in_words
from twin.engagement.along_path import Section, engaged_along
from twin.errors import MachineError
from twin.learned.standing import seconds_of
from twin.machine import MachineFile, Program
from twin.motion.control import RAPID_MM_MIN, control_of, effects_tell
from twin.motion.motion import ExecState, Motion
from twin.motion.path import EventKind, Kind, Path, path_from_moves
from twin.motion.plan import Plan
from twin.motion.sampling import sampled
from twin.programs import FeedForward, Settings
from twin.programs.called import with_line_elsewhere
from twin.programs.discovery import dialect_of
from twin.programs.fanuc.lathe import lathe_remarks
from twin.programs.remarks import remarks
from twin.programs.source import source_lines
from twin.runlog import RunLog, run_log
from twin.simulator.response import Response, RunInput, respond

Floats = NDArray[np.float64]

IDEAL_TIMES = Program(
    rapid_mm_min=RAPID_MM_MIN, acceleration_mm_s2=2500.0, jerk_mm_s3=60000.0, corner_speed_difference_mm_min=500.0
)
"""A middling control: used to plan a program where neither [program] nor an effect of the machine describes its own."""
TICKS_MAX = 8_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Simulation:
    """A run of the simulated machine.

    run: what it records, at the servo period; response: with the spread of its courses; plan: with the times of each line
    notes: remarks on the program; what the machine description did not say, and what was taken for it
    learned_s: seconds that learned terms add
    """

    run: RunLog
    response: Response
    plan: Plan
    notes: tuple[str, ...]
    learned_s: float = 0.0

    @property
    def seconds(self) -> float:
        """Time that the program takes."""
        return self.plan.total_s + self.learned_s

    def following_error_mm(self) -> Mapping[str, Floats]:
        """Axis → reference minus position, (n,)."""
        return {
            a: self.run[f"{a}_ref_mm"] - self.run[f"{a}_pos_mm"] for a in self.run.axes() if f"{a}_pos_mm" in self.run.columns
        }


def simulate(
    machine: MachineFile,
    text: str,
    *,
    seed: int | None = None,
    start_temperature_c: float | None = None,
    ambient_temp_c: float = 22.0,
    settings: Settings | None = None,
    name: str = "program",
) -> Simulation:
    """Runs a part program on a machine.

    settings: None = those of the machine; else with the texts of the programs that this one calls, whose moves have a line beyond
        the last one of this text
    seed: None = the machine's mean course, free of noise; a number = one course as its sensors would record it
    start_temperature_c: of the spindle; None = ambient

    Raises PartProgramError where a control would refuse the program, MachineError where the machine lacks its axes or the run
    would be longer than 8 million ticks, EffectError where its effects do not fit.
    """
    settings = program_settings(machine) if settings is None else settings
    dialect = dialect_of(text, settings)
    own = dialect.interpret(text, settings)
    notes: list[str] = [*lathe_remarks(machine.axes)]
    moves = with_line_elsewhere(own, len(source_lines(text)))
    path = path_from_moves(moves, settings.start_mm or None, settings.axes)
    moving = [a for column, a in enumerate(path.axes) if np.any(path.start_mm[:, column] != path.end_mm[:, column])]
    missing = [a for a in moving if a not in machine.axes]
    if missing:
        follow = "follow their references" if len(missing) > 1 else "follows its reference"
        notes.append(f"no [axes.{missing[0]}]: {' and '.join(missing)} {follow} without error in this run")
    if switched := next((move for move in moves if isinstance(move, FeedForward)), None):
        notes.append(f"line {switched.line + 1}: the feed-forward that the program switches is not simulated; the machine's is")
    planned = program_plan(machine, path, notes)
    period_s = machine.machine.servo_period_s
    if planned.total_s / period_s > TICKS_MAX:
        raise MachineError(f"{name} takes {planned.total_s:.0f} s, more than {TICKS_MAX} ticks of {period_s} s; split it")
    motion = sampled(planned, period_s)
    engaged, met = _engagement(machine, path, motion, notes)
    notes = [*remarks(dialect, text, own, met), *notes]
    angle = np.concatenate([[0.0], np.cumsum(motion.spindle_rpm)[:-1]]) * (2.0 * np.pi / 60.0 * period_s)
    told = RunInput(
        t_s=motion.t_s,
        reference_mm={a: np.ascontiguousarray(motion.reference_mm[:, i]) for i, a in enumerate(path.axes)},
        spindle_rpm=motion.spindle_rpm,
        spindle_angle_rad=np.mod(angle, 2.0 * np.pi),
        axial_depth_mm=engaged["axial_depth_mm"],
        entry_angle_rad=engaged["entry_angle_rad"],
        exit_angle_rad=engaged["exit_angle_rad"],
        coolant_on=_coolant(planned, motion),
        ambient_temp_c=np.full(len(motion), ambient_temp_c),
        start_temp_c=start_temperature_c,
    )
    response = respond(machine, told, seed=seed)
    notes += [
        f"the learned term at {term} describes the time of a recording; it is left out"
        for term in machine.learned
        if term.is_recording
    ]
    notes += _saturated(machine, response)
    if assumed := assumed_in_words(machine):
        notes.append(f"assumed, neither stated nor fitted: {assumed}")
    learned_s = seconds_of(machine.learned, planned.total_s)
    if learned_s:
        notes.append(f"{learned_s:.2f} s of the program's time are a learned term: they are in no signal of this run")
    run = replace(_log(motion, told, response, path, name), rotary=frozenset(machine.rotary))
    return Simulation(run, response, planned, tuple(notes), learned_s)


def program_settings(machine: MachineFile) -> Settings:
    """The settings of the control, with a word for each rotary axis of the machine, which starts at 0 deg."""
    settings = machine.settings
    if not (more := (0.0,) * (len(machine.words) - 3)):
        return settings
    return replace(
        settings,
        axes=machine.words,
        start_mm=(*settings.start_mm, *more) if settings.start_mm else (),
        work_offsets_mm={name: (*place, *more) for name, place in settings.work_offsets_mm.items()},
        references_mm=tuple((*place, *more) for place in settings.references_mm),
    )


def program_plan(machine: MachineFile, path: Path, notes: list[str]) -> Plan:
    """The plan of the control that the machine states, as its effects change it."""
    if machine.program is None and not effects_tell(machine):
        notes.append("no [program]: 30 m/min, 2.5 m/s², 60 m/s³ and corners of 500 mm/min were taken for the control")
    elif machine.program is None:
        notes.append("no [program]: rapids at 30 m/min, length over feed, and what the effects of the machine add to it")
    return control_of(machine, IDEAL_TIMES).plan(path)


def _saturated(machine: MachineFile, response: Response) -> list[str]:
    """Axes that are at their torque limit for more than a hundredth of the run."""
    said = []
    for letter, axis in machine.axes.items():
        torque = response.columns.get(f"{letter}_torque_a")
        part = 0.0 if torque is None else float(np.mean(np.abs(torque) > 0.98 * axis.torque_limit_a))
        if part > 0.01:
            said.append(
                f"{letter} is at its torque limit of {axis.torque_limit_a:g} A for {100 * part:.0f} % of the run: a control "
                f"would stop it; check mass, lead, gains and limit of axes.{letter}, and the acceleration in [program]"
            )
    return said


def _engagement(
    machine: MachineFile, path: Path, motion: Motion, notes: list[str]
) -> tuple[dict[str, Floats], frozenset[int] | None]:
    """Depth and angles of the cut at each tick; nothing is cut where the machine states no stock or no tool.

    Also returns the lines that meet the stock, None where that is not known.
    """
    ticks = len(motion)
    none = {name: np.zeros(ticks) for name in ("axial_depth_mm", "entry_angle_rad", "exit_angle_rad")}
    if machine.stock is None or machine.tool is None:
        if (path.kind != Kind.RAPID).any():
            one_only = " (simulate knows one tool, [tool]; cnctwin expect knows [tools.N])" if machine.tools else ""
            missing = "[stock]" if machine.stock is None else f"[tool]{one_only}"
            notes.append(f"no {missing}: the program is run in air")
        return none, None
    if path.axes[:3] != ("x", "y", "z") or not len(path):
        return none, None
    if len({event.value for event in path.events if event.kind == EventKind.TOOL_CHANGE}) > 1:
        one = f"the {machine.tool.diameter_mm:g} mm one of [tool]"
        beside = "; expect and optimise take each [tools.N]" if machine.tools else ""
        notes.append(f"the program changes tools, and this run cuts with {one} throughout{beside}")
    rows = engaged_along(path, machine.stock, [Section(0, len(path), machine.tool.diameter_mm)])
    for hit in rows.collisions[:3]:
        line = int(path.line[hit.segment]) + 1
        notes.append(f"line {line}: rapid into material at " + ", ".join(f"{v:.1f}" for v in hit.position_mm) + " mm")
    length_mm = path.length_mm[motion.segment]
    row = rows.row_at(motion.segment, np.where(length_mm > 0.0, motion.s_mm / np.maximum(length_mm, 1e-12), 0.0))
    feeding = (path.kind[motion.segment] != Kind.RAPID) & (motion.feed_mm_min > 0.0)
    cutting = feeding & (motion.spindle_rpm > 0.0) & (motion.spindle_direction > 0)
    in_material = feeding & (rows.axial_depth_mm[row] > 0.0)
    for wrong, why in (
        (in_material & (motion.spindle_rpm == 0.0), "feeds into material with the spindle at rest"),
        (in_material & (motion.spindle_direction < 0), "M4: a right-hand tool does not cut; no force is computed"),
    ):
        if wrong.any():
            notes.append(f"line {int(motion.line[int(np.argmax(wrong))]) + 1}: {why}")
    return {name: np.where(cutting, getattr(rows, name)[row], 0.0) for name in none}, rows.lines_met(path)


def _coolant(planned: Plan, motion: Motion) -> Floats:
    """1 while the coolant runs."""
    switches = [
        (start, event.value)
        for event, start in zip(planned.path.events, planned.event_start_s, strict=True)
        if event.kind == EventKind.COOLANT
    ]
    on = np.zeros(len(motion))
    for start, value in switches:
        on[motion.t_s >= start] = float(value > 0)
    return on


def _log(motion: Motion, told: RunInput, response: Response, path: Path, name: str) -> RunLog:
    """Everything that a run log can hold of it."""
    columns: dict[str, NDArray[Any]] = {"t_s": motion.t_s, "line": motion.line.astype(np.float64)}
    for i, axis in enumerate(path.axes):
        columns[f"{axis}_ref_mm"] = motion.reference_mm[:, i]
    assert told.axial_depth_mm is not None
    assert told.entry_angle_rad is not None
    assert told.exit_angle_rad is not None
    idle = told.axial_depth_mm <= 0.0
    told_columns: dict[str, NDArray[Any] | None] = {
        "spindle_rpm": motion.spindle_rpm,
        "spindle_angle_rad": told.spindle_angle_rad,
        "axial_depth_mm": told.axial_depth_mm,
        "entry_angle_rad": np.where(idle, np.nan, told.entry_angle_rad),
        "exit_angle_rad": np.where(idle, np.nan, told.exit_angle_rad),
        "coolant_on": told.coolant_on,
        "ambient_temp_c": told.ambient_temp_c,
        "feed_mm_min": motion.feed_mm_min,
        "tool_number": np.where(motion.tool_number > 0, motion.tool_number.astype(np.float64), np.nan),
        "tool_change_active": motion.tool_change_active.astype(np.float64),
        "exec_state": np.array([state.name for state in ExecState], dtype=object)[motion.exec_state],
    }
    columns |= {key: values for key, values in told_columns.items() if values is not None}
    columns |= response.columns
    return run_log(columns, name)
