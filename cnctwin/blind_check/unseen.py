"""How much of the gap a diagnosed twin closes on runs of its machine that the diagnosis never had.

Before is what the effects change in a run; what is left is the rms of twin minus recording; both over what repeated runs of the
same machine differ by, which is all that the twin with the true form can reach.
"""

import numpy as np

from cnctwin.blind_check.answer import Answer
from cnctwin.blind_check.case_folder import UNSEEN, machine_of, physics_with, recorded
from cnctwin.blind_check.question import Question
from cnctwin.reference_machine.recording import Columns
from cnctwin.reference_machine.size import rms_by_signal
from twin.gap.diagnosis import closure_of
from twin.machine import MachineFile
from twin.recorded import told_of
from twin.response import respond
from twin.runlog import run_log


def closure_on_unseen(question: Question, answer: Answer, twin: MachineFile) -> float | None:
    """Share of the reducible gap that is gone, 0 to 1, over all signals; None where there is next to nothing to close."""
    machine = machine_of(question)
    physics = physics_with(machine, answer)
    there, left = 0.0, 0.0
    for kind in question.kinds:
        run = recorded(machine, physics, kind, UNSEEN)
        again = [recorded(machine, physics, kind, UNSEEN, seed=seed) for seed in (20, 21)]
        differ = rms_by_signal([run, *again], [again[0], again[1], run])
        changed = rms_by_signal([run], [recorded(machine, machine.healthy, kind, UNSEEN)])
        for name, value in _off(twin, run).items():
            floor = differ[name] / np.sqrt(2.0)
            there += (changed[name] / floor) ** 2
            left += (value / floor) ** 2 - 1.0
    return closure_of(np.sqrt(1.0 + there), np.sqrt(1.0 + max(left, 0.0)), 1.0) if there > 1.0 else None


def _off(twin: MachineFile, run: Columns) -> dict[str, float]:
    """Signal → rms of twin minus recording."""
    log = run_log(run)
    load = {"spindle_load_pct": log["spindle_load_pct"]} if not log.axes() else None
    columns = respond(twin, told_of(log, twin), recorded=load).columns
    names = [name for name in columns if log.has(name) and not (load and name in load) and run[name].dtype == np.float32]
    return {name: float(np.sqrt(np.nanmean((columns[name] - log[name]) ** 2))) for name in names}
