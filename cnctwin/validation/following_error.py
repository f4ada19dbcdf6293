"""Following error: rms of twin minus measured, in % of the measured following error's rms, by axis.

Both follow the recorded reference, so what they differ in is their position; the percentage says how much of the following error
the twin does not explain. It needs the reference that enters the position loop, at the period of the servo loop.
"""

import numpy as np

from cnctwin.validation.block_bootstrap import block_samples, block_sums, bootstrapped
from cnctwin.validation.budgets import Budgets
from cnctwin.validation.evidence import Evidence
from cnctwin.validation.figure import Figure, Verdict, judged, unseen
from cnctwin.validation.model import Twin
from twin.errors import TwinError
from twin.simulator.recorded import told_of
from twin.simulator.response import respond

QUANTITY, MEASURE, UNIT = "following_error", "rms_pct", "%"
COURSES = 4


def judged_following_error(twin: Twin, evidence: Evidence, budgets: Budgets) -> list[Figure]:
    """A figure for each axis of the twin whose reference and position were recorded."""
    budget = budgets.following_error_pct
    machine, log = twin.file, evidence.run
    letters = [] if log is None else [a for a in log.axes() if log.has(f"{a}_ref_mm", f"{a}_pos_mm")]
    if log is None or not letters:
        return unseen(
            QUANTITY, [(MEASURE, UNIT, budget)], "position references are not recorded; a store has none, a servo trace does"
        )
    if machine is None or not (shown := [a for a in letters if a in machine.axes]):
        return unseen(QUANTITY, [(MEASURE, UNIT, budget)], f"no machine.toml describes the axes {', '.join(letters)}")
    try:
        columns = respond(machine, told_of(log, machine), courses=COURSES).columns
    except TwinError as error:
        return unseen(QUANTITY, [(MEASURE, UNIT, budget)], str(error))
    figures = []
    for axis in shown:
        own = log[f"{axis}_ref_mm"] - log[f"{axis}_pos_mm"]
        gap = log[f"{axis}_pos_mm"] - columns[f"{axis}_pos_mm"]
        there = np.isfinite(own) & np.isfinite(gap)
        size, apart = float(np.sqrt(np.mean(own[there] ** 2))), float(np.sqrt(np.mean(gap[there] ** 2)))
        hours = float(there.sum()) * machine.machine.servo_period_s / 3600.0
        basis = f"{1000 * apart:.2f} µm of {1000 * size:.1f} µm rms, twin along the recorded reference"
        if not there.any() or size < 1e-6:
            why = "the axis has no following error: it does not move"
            figures.append(Figure(QUANTITY, MEASURE, UNIT, budget, Verdict.UNSEEN, on=axis, basis=basis, reason=why))
            continue
        square = np.where(there, gap**2, np.nan)
        sums = block_sums(np.column_stack([square, np.where(there, own**2, np.nan)]), block_samples(square))
        one = bootstrapped(sums, lambda s: 100.0 * np.sqrt(s[:, 0] / np.maximum(s[:, 1], 1e-30)))
        verdict = judged(one.value, budget)
        samples = int(there.sum())
        figures.append(
            Figure(
                QUANTITY, MEASURE, UNIT, budget, verdict, one.value, one.low, one.high, samples, hours, one.blocks, axis, basis
            )
        )
    return figures
