"""Cutting force against a dynamometer: mean absolute error in %, of windows that cut.

A dynamometer sees the force across the tool, √(F_x² + F_y²), tooth by tooth; compared are means over a window. Where a run tells
the cut, the twin's is that of the milling model. Else it is the mean tangential force by spindle power, times √(1 + K_e²) where
the machine states F_r / F_t: right where one tooth cuts at a time; the forces of several partly cancel. Windows in which the
spindle changes its speed are left out, since its load is its inertia then.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cnctwin.validation.block_bootstrap import block_samples, block_sums, bootstrapped
from cnctwin.validation.budgets import Budgets
from cnctwin.validation.evidence import FORCE, RESULTANT, SPEED, Evidence, resultant_of
from cnctwin.validation.figure import Figure, Verdict, judged, unseen
from cnctwin.validation.model import Twin, milling_force, power_force
from cnctwin.validation.track import Floats, Grid, Track, averaged, held

QUANTITY = "force"
STORE_EVERY_S, RUN_EVERY_S = 1.0, 0.1
HELD_S = 10.0
SPEED_CHANGE = 0.02
SHOWN_MIN = 0.5
"""The share of the cutting windows for which the twin has to have a force: else its figure is of another cut than measured."""


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """twin, truth: (count,) mean force across the tool in each window, N"""

    twin: Floats
    truth: Floats
    basis: str


def judged_force(twin: Twin, evidence: Evidence, budgets: Budgets) -> list[Figure]:
    """One figure."""
    measure = ("mape", "%", budgets.force_mape_pct)
    measured = evidence.truth.get(RESULTANT)
    origin = "the truth file's dynamometer"
    if measured is None and evidence.run is not None:
        measured, origin = resultant_of(evidence.run), "the run's dynamometer"
    if measured is None:
        return unseen(QUANTITY, [measure], evidence.truth_reason or "no force_x_n, force_y_n: the force was not measured")
    every_s = STORE_EVERY_S if evidence.run is None else RUN_EVERY_S
    grid = Grid.over(evidence.from_s, evidence.to_s, every_s)
    try:
        found = _compared(twin, evidence, grid, measured)
    except LookupError as error:
        return unseen(QUANTITY, [measure], str(error.args[0]))
    return [_figure(found, evidence, grid, budgets, f"{found.basis}; against {origin}, means over {every_s:g} s")]


def _compared(twin: Twin, evidence: Evidence, grid: Grid, measured: Track) -> Compared:
    truth = averaged(measured, grid)
    if twin.file is not None and evidence.run is not None:
        modelled = milling_force(twin.file, evidence.run)
        if modelled is not None:
            return Compared(averaged(Track(evidence.run.t_s, modelled), grid), truth, "milling model over the recorded cut")
    published = evidence.twin.get(FORCE)
    if published is not None and published.is_known:
        means = averaged(published, grid)
        tangential, basis = np.where(np.isfinite(means), means, held(published, grid, HELD_S)), f"{FORCE} as published"
    else:
        tangential, basis = power_force(twin, evidence, grid, HELD_S)
    if twin.file is None or twin.file.tool is None:
        raise LookupError(
            "the dynamometer sees F_t and F_r together; radial_ratio in [tool] of machine.toml tells one from the other"
        )
    ratio = twin.file.tool.radial_ratio
    return Compared(tangential * np.hypot(1.0, ratio), truth, f"{basis}, times √(1 + {ratio:g}²)")


def _figure(found: Compared, evidence: Evidence, grid: Grid, budgets: Budgets, basis: str) -> Figure:
    budget = budgets.force_mape_pct
    steady = _steady(evidence, grid)
    cutting = np.isfinite(found.truth) & (found.truth > budgets.force_floor_n) & steady
    both = cutting & np.isfinite(found.twin)
    count, cut_s = int(both.sum()), float(both.sum()) * grid.every_s
    basis = f"{basis}, above {budgets.force_floor_n:g} N"
    shown = count / max(int(cutting.sum()), 1)
    if cut_s < budgets.force_cutting_s_min or shown < SHOWN_MIN:
        why = f"{cut_s:.3g} s of cutting with both forces; {budgets.force_cutting_s_min:g} s are needed"
        needed: float | None = budgets.force_cutting_s_min / 3600.0
        if cut_s >= budgets.force_cutting_s_min:
            why, needed = f"the twin has a force in {100 * shown:.0f} % of the windows that cut only", None
        few = Figure(QUANTITY, "mape", "%", budget, Verdict.TOO_LITTLE, samples=count, hours=cut_s / 3600.0, basis=basis)
        return replace(few, reason=why, hours_needed=needed)
    error = np.where(both, 100.0 * np.abs(found.twin - found.truth) / np.where(both, found.truth, 1.0), np.nan)
    sums = block_sums(np.column_stack([error, np.where(both, 1.0, np.nan)]), block_samples(error))
    one = bootstrapped(sums, lambda s: s[:, 0] / s[:, 1])
    if shown < 1.0:
        basis += f"; the twin has none in {100 * (1 - shown):.0f} % of them, which are left out"
    verdict = judged(one.value, budget)
    hours = cut_s / 3600.0
    return Figure(QUANTITY, "mape", "%", budget, verdict, one.value, one.low, one.high, count, hours, one.blocks, basis=basis)


def _steady(evidence: Evidence, grid: Grid) -> NDArray[np.bool_]:
    """(count,) whether the spindle keeps its speed in a window and beside it; where the speed is not told, it is taken to."""
    speed = held(evidence.told.get(SPEED), grid, np.inf)
    if not np.isfinite(speed).any():
        return np.ones(grid.count, dtype=np.bool_)
    change = np.abs(np.diff(speed, prepend=speed[:1])) > SPEED_CHANGE * np.maximum(np.abs(speed), 1.0)
    return np.asarray(~(change | np.append(change[1:], False)))
