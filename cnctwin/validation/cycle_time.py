"""Cycle time: what the twin says programs take against what they took, pauses taken out, program by program.

The runs of a program count together: 100 · |Σ predicted − Σ taken| / Σ taken. A program is judged where its text is given and the
control told its lines; a run that was broken off, or is of another program than the text, is left out and said to be.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cnctwin.files.called_programs import with_called_programs
from cnctwin.files.program_folder import ProgramFolder
from cnctwin.validation.block_bootstrap import bootstrapped
from cnctwin.validation.budgets import Budgets
from cnctwin.validation.figure import Figure, Verdict, judged, unseen
from cnctwin.validation.model import Twin
from twin.case import RunAtHand, RunEntry, RunKind
from twin.errors import TwinError
from twin.gap.programs.fit import REFERENCE_START_MM, Model, Watched
from twin.gap.programs.trial import Trial, trial_of
from twin.motion.control import program_effects
from twin.motion.limits import Limits
from twin.motion.path import path_from_moves
from twin.programs import Settings, interpret
from twin.recording.program_run import OVERRIDES
from twin.runlog import RunLog

QUANTITY, MEASURE, UNIT = "cycle_time", "error_pct", "%"
REFUSED_SHOWN = 2
TITLE_MAX = 60
LONG_LINE_S, TOLD_MIN = 1.0, 0.9
"""A run tells the lines on which it stays for so long, or so much of them."""


@dataclass(frozen=True, slots=True, eq=False)
class Cycle:
    """One execution of a program, from its start to its end."""

    program: str
    log: RunLog


@dataclass(frozen=True, slots=True, eq=False)
class Cycles:
    """The cycles of a stretch. texts: name of a program → NC file; reason: why there is no cycle, where there is none"""

    cycles: Sequence[Cycle]
    texts: Mapping[str, Path]
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Timed:
    """The times of one run: what the twin says, and what it took, s."""

    predicted_s: float
    taken_s: float


class ControlModel(NamedTuple):
    """The model of the control: how it moves, and what it makes of a program beside its text."""

    model: Model
    settings: Settings


def judged_cycle_time(twin: Twin, given: Cycles, budgets: Budgets) -> list[Figure]:
    """A figure for each program."""
    measure = [(MEASURE, UNIT, budgets.cycle_time_pct)]
    cycles = given.cycles
    if not cycles:
        return unseen(QUANTITY, measure, given.reason)
    if twin.file is None or twin.file.program is None:
        return unseen(QUANTITY, measure, "[program] of machine.toml does not state how the control moves")
    model = Model(Limits.of(twin.file.program), program_effects(twin.file))
    control = ControlModel(model, replace(twin.file.settings, optional_stop=True))
    figures: list[Figure] = []
    for program in sorted({cycle.program for cycle in cycles}):
        own = [cycle for cycle in cycles if cycle.program == program]
        path = given.texts.get(program)
        if path is None:
            why = f"ran {len(own)} times; its text is not among the programs given"
            figures += unseen(QUANTITY, measure, why, program[:TITLE_MAX])
            continue
        figures.append(_of_program(control, program, own, path, budgets))
    return figures


def _of_program(control: ControlModel, program: str, cycles: Sequence[Cycle], path: Path, budgets: Budgets) -> Figure:
    timed: list[Timed] = []
    refused: list[str] = []
    references = False
    for cycle in cycles:
        entry = RunEntry(file=program, kind=RunKind.PROGRAM, role="check", program=path.name)
        trial = trial_of(RunAtHand(entry, path.parent, cycle.log), control.settings)
        if isinstance(trial, Trial):
            references |= trial.references
            timed.append(_timed(control.model, trial))
        elif isinstance(whole := whole_of(cycle.log, path, control), Timed):
            timed.append(whole)
        else:
            refused.append(f"{trial.why}; {whole}")
    budget, title = budgets.cycle_time_pct, program[:TITLE_MAX]
    said = f"; {len(refused)} left out: {'; '.join(dict.fromkeys(refused[:REFUSED_SHOWN]))}" if refused else ""
    if not timed:
        return Figure(QUANTITY, MEASURE, UNIT, budget, Verdict.UNSEEN, on=title, reason=f"no run can be compared{said}")
    sums = np.array([[one.predicted_s, one.taken_s] for one in timed])
    found = bootstrapped(sums, lambda s: 100.0 * np.abs(s[:, 0] / s[:, 1] - 1.0))
    predicted_s, taken_s = sums.mean(axis=0).tolist()
    basis = f"{len(timed)} runs: predicted {predicted_s:.1f} s, took {taken_s:.1f} s without pauses{said}"
    if references:
        basis += f"; where the reference position lies is not told, {REFERENCE_START_MM:g} mm above the work is taken"
    hours, verdict = float(sums[:, 1].sum()) / 3600.0, judged(found.value, budget)
    return Figure(
        *(QUANTITY, MEASURE, UNIT, budget, verdict, found.value, found.low, found.high),
        samples=len(timed), hours=hours, blocks=found.blocks, on=title, basis=basis,
    )  # fmt: skip


def _timed(model: Model, trial: Trial) -> Timed:
    plan = Watched.of(trial, 1.0).plan(model)
    return Timed(float(plan.total_s), float(trial.recorded.run.active_s))


def whole_of(log: RunLog, path: Path, control: ControlModel) -> Timed | str:
    """A run as a whole, where its lines do not ascend to the end of the text, as with subprograms below M30; else why not.

    It has to have told the lines on which the twin says that most time is spent, and overrides of 100 %.
    """
    if not log.has("line") or "PROGRAM_COMPLETED" not in (states := log.text.get("exec_state", np.zeros(0, dtype=object))):
        return "nothing says that it was finished"
    if any(log.has(name) and float(np.nanmax(np.abs(log[name] - 100.0))) > 0.5 for name in OVERRIDES.values()):
        return "an override was turned"
    try:
        text = path.read_text(encoding="utf-8")
        moves = interpret(text, with_called_programs(control.settings, path, text))
        planned = control.model.control.plan(path_from_moves(moves, control.settings.start_mm or None))
    except (TwinError, OSError, UnicodeDecodeError) as error:
        return str(error)
    seconds = planned.seconds_by_line()
    long = set(np.flatnonzero(seconds >= LONG_LINE_S).tolist())
    told = set(np.unique(log["line"][np.isfinite(log["line"])]).astype(np.int64).tolist())
    if not long or len(long & told) < TOLD_MIN * len(long):
        return f"it told {len(long & told)} of the {len(long)} lines that take longest"
    active = np.array([str(state) == "ACTIVE" for state in states[:-1]], dtype=np.bool_)
    return Timed(float(planned.total_s), float(np.diff(log.t_s)[active].sum()))


def texts_of(folder: Path | None, names: Sequence[str]) -> dict[str, Path]:
    """Name of a program as a control tells it → its file in a folder. Raises UsageError where there is no such folder."""
    files = ProgramFolder(folder)
    return {name: path for name in names if (path := files.path_of(name)) is not None}
