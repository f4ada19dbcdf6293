"""The share of the gap that a diagnosed twin closes on runs of its machine that the diagnosis never had.

Before is what the effects change in a run; what is left is twin minus recording where the twin is compared
(`twin.gap.stages.shown`); both over what repeated runs of the same machine differ by, which is all that the twin with the
true form can reach.
"""

from pathlib import Path

import numpy as np

from cnctwin.blind_check.answer import Answer
from cnctwin.blind_check.case_folder import UNSEEN, machine_of, physics_with, recorded
from cnctwin.blind_check.question import Question
from cnctwin.standins.reference_machine.recording import Columns
from twin.case import Run, RunAtHand, RunEntry
from twin.gap.diagnosis import closure_of
from twin.gap.floors import repeatability
from twin.gap.stages.shown import shown
from twin.machine import MachineFile
from twin.runlog import run_log


def closure_on_unseen(question: Question, answer: Answer, twin: MachineFile) -> float | None:
    """Share of the reducible gap that is gone, 0 to 1, over all signals; None where there is next to nothing to close."""
    machine = machine_of(question)
    physics = physics_with(machine, answer)
    there, left = 0.0, 0.0
    for kind in question.kinds:
        run = _run(kind, recorded(machine, physics, kind, UNSEEN))
        again = [_run(kind, recorded(machine, physics, kind, UNSEEN, seed=seed)) for seed in (20, 21)]
        bare = _run(kind, recorded(machine, machine.healthy, kind, UNSEEN)).log
        floors = repeatability((), ((run, again[0]), (run, again[1]), (again[0], again[1])), twin)
        for name, values in shown(twin, run, floors).items():
            compared, floor = np.isfinite(values) & np.isfinite(run.log[name]), floors.of(run.log, name)
            there += _mean_square((run.log[name] - bare[name])[compared] / floor[compared])
            left += _mean_square((values - run.log[name])[compared] / floor[compared]) - 1.0
    return closure_of(np.sqrt(1.0 + there), np.sqrt(1.0 + max(left, 0.0)), 1.0) if there > 1.0 else None


def _run(kind: str, columns: Columns) -> Run:
    entry = RunEntry.model_validate({"file": kind, "kind": kind, "role": "check"})
    return RunAtHand(entry, Path(), run_log(columns))


def _mean_square(values: np.ndarray) -> float:
    return float(np.mean(values**2)) if len(values) else 0.0
