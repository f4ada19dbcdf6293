"""Vibration: how well the estimated rms (10 to 1000 Hz) goes with a reference, as a correlation.

That a standing spindle shakes less than a turning one needs no estimate: where the speed is known, only a turning spindle counts.
"""

from dataclasses import replace

import numpy as np

from cnctwin.validation.block_bootstrap import block_samples, block_sums, bootstrapped
from cnctwin.validation.budgets import Budgets
from cnctwin.validation.evidence import SHAKEN, SPEED, VIBRATION, Evidence
from cnctwin.validation.figure import Figure, Verdict, judged, unseen
from cnctwin.validation.track import Floats, Grid, Track, averaged, held

QUANTITY = "vibration"
EVERY_S = 1.0
HELD_S = 10.0
TURNING_RPM_MIN = 50.0
CONSTANT = 1e-9


def judged_vibration(evidence: Evidence, budgets: Budgets) -> list[Figure]:
    """One figure."""
    measure = ("r", "", budgets.vibration_r)
    estimate, reference, basis = _pair(evidence)
    if estimate is None or reference is None:
        return unseen(QUANTITY, [measure], evidence.truth_reason or basis)
    grid = Grid.over(evidence.from_s, evidence.to_s, EVERY_S)
    one, other = _known(estimate, grid), _known(reference, grid)
    both = np.isfinite(one) & np.isfinite(other)
    speed = held(evidence.told.get(SPEED), grid, np.inf)
    if np.isfinite(speed).any():
        both &= np.abs(np.nan_to_num(speed)) > TURNING_RPM_MIN
        basis += ", while the spindle turns"
    count = int(both.sum())
    seconds = count * EVERY_S
    if seconds < budgets.vibration_s_min:
        why = f"{seconds:g} s with both; {budgets.vibration_s_min:g} s are needed"
        few = _none(Verdict.TOO_LITTLE, budgets, count, basis, why)
        return [replace(few, hours_needed=budgets.vibration_s_min / 3600.0)]
    one, other = np.where(both, one, np.nan), np.where(both, other, np.nan)
    for values, what in ((one, "estimate"), (other, "reference")):
        if float(np.nanstd(values)) <= CONSTANT * max(float(np.nanmax(np.abs(values))), CONSTANT):
            return [_none(Verdict.UNSEEN, budgets, count, basis, f"the {what} does not change, so nothing goes with it")]
    terms = _terms(one, other)
    length = max(block_samples(one), block_samples(other))
    found = bootstrapped(block_sums(terms, length), correlation)
    verdict = judged(found.value, budgets.vibration_r, at_least=True)
    hours = seconds / 3600.0
    low, high = (None if end is None else float(np.clip(end, -1.0, 1.0)) for end in (found.low, found.high))
    return [
        Figure(QUANTITY, "r", "", budgets.vibration_r, verdict, found.value, low, high, count, hours, found.blocks, basis=basis)
    ]


def _pair(evidence: Evidence) -> tuple[Track | None, Track | None, str]:
    """Estimate and reference, and in words what they are, or why there are not both."""
    published, told, truth = evidence.twin.get(SHAKEN), evidence.told.get(VIBRATION), evidence.truth.get(VIBRATION)
    estimate, name = (published, SHAKEN) if published is not None and published.is_known else (told, VIBRATION)
    if estimate is None or not estimate.is_known:
        return None, None, f"neither {SHAKEN} nor {VIBRATION} is recorded"
    if truth is not None and truth.is_known:
        return estimate, truth, f"{name} beside the truth file's {VIBRATION}"
    if name == SHAKEN and told is not None and told.is_known:
        return estimate, told, f"{SHAKEN} beside the machine's {VIBRATION}"
    return None, None, f"no reference beside {name}"


def _known(track: Track, grid: Grid) -> Floats:
    means = averaged(track, grid)
    return np.where(np.isfinite(means), means, held(track, grid, HELD_S))


def _none(verdict: Verdict, budgets: Budgets, count: int, basis: str, reason: str) -> Figure:
    hours = count * EVERY_S / 3600.0
    return Figure(QUANTITY, "r", "", budgets.vibration_r, verdict, samples=count, hours=hours, basis=basis, reason=reason)


def _terms(one: Floats, other: Floats) -> Floats:
    """(n, 6) what a correlation is made of; centred first, so that no digits are lost."""
    a, b = one - np.nanmean(one), other - np.nanmean(other)
    return np.column_stack([np.where(np.isfinite(a * b), 1.0, np.nan), a, b, a * a, b * b, a * b])


def correlation(sums: Floats) -> Floats:
    """Pearson's r (d,) of sums (d, 6): n, Σa, Σb, Σa², Σb², Σab; NaN where one of them does not change."""
    n, a, b, aa, bb, ab = sums.T
    scale = np.sqrt(np.maximum(aa - a * a / n, 0.0) * np.maximum(bb - b * b / n, 0.0))
    return np.where(scale > 0.0, (ab - a * b / n) / np.where(scale > 0.0, scale, 1.0), np.nan)
