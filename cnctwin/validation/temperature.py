"""Spindle temperature: mean absolute and root mean square error, of all, and of the hour in which it was worst.

Where the store holds what the twin published, that is judged; else the twin runs over what was recorded. It is begun with the
measured temperature, so it is right for a while at the beginning: a time constant of the spindle, a quarter to a whole hour.
"""

from dataclasses import dataclass, replace

import numpy as np

from cnctwin.validation.block_bootstrap import Interval, block_samples, block_sums, bootstrapped
from cnctwin.validation.budgets import Budgets
from cnctwin.validation.evidence import MODELLED, TEMPERATURE, Evidence
from cnctwin.validation.figure import Figure, Verdict, judged, unseen
from cnctwin.validation.model import Twin, temperature
from cnctwin.validation.track import Floats, Grid, averaged, held

QUANTITY = "temperature"
EVERY_S = 10.0
HOUR_S = 3600.0


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """Twin minus truth (count,), of all and of each hour of which enough was seen; hours in all; what was compared."""

    error: Floats
    pieces: list[Floats]
    hours: float
    basis: str


def judged_temperature(twin: Twin, evidence: Evidence, budgets: Budgets) -> list[Figure]:
    """Four figures: mae and rmse of all and of the worst hour."""
    measures = [
        (f"{name}{part}", "K", budget)
        for name, budget in (("mae", budgets.temperature_mae_k), ("rmse", budgets.temperature_rmse_k))
        for part in ("", "_worst_hour")
    ]
    grid = Grid.over(evidence.from_s, evidence.to_s, EVERY_S)
    truth, origin = _truth(evidence, grid, budgets)
    if truth is None:
        return unseen(QUANTITY, measures, origin)
    try:
        modelled, basis = _modelled(twin, evidence, grid, budgets)
    except LookupError as missing:
        return unseen(QUANTITY, measures, str(missing.args[0]))
    error = modelled - truth
    hours = int(np.isfinite(error).sum()) * EVERY_S / HOUR_S
    basis = f"{basis}; against {origin}"
    seen = _Seen(error, _hours(error, budgets), hours, basis)
    return [_figure(measure, seen, budgets) for measure in measures]


def _truth(evidence: Evidence, grid: Grid, budgets: Budgets) -> tuple[Floats | None, str]:
    """The temperature to be judged by, and whose it is; else why there is none."""
    found = evidence.truth.get(TEMPERATURE)
    origin = "the truth file's"
    if found is None:
        found, origin = evidence.told.get(TEMPERATURE), "the machine's own sensor"
    if found is None or not found.is_known:
        return None, evidence.truth_reason or f"{TEMPERATURE} was not measured"
    means = averaged(found, grid)
    return np.where(np.isfinite(means), means, held(found, grid, budgets.held_s_max)), origin


def _modelled(twin: Twin, evidence: Evidence, grid: Grid, budgets: Budgets) -> tuple[Floats, str]:
    """As published; else computed. Raises LookupError with the reason for neither."""
    published = evidence.twin.get(MODELLED)
    if published is not None and published.is_known:
        return held(published, grid, budgets.held_s_max), f"{MODELLED} as published"
    return temperature(twin, evidence, grid, budgets.held_s_max)


def _hours(error: Floats, budgets: Budgets) -> list[Floats]:
    """The errors of each hour of which enough was seen, hours counted from the beginning of the stretch."""
    samples = round(HOUR_S / EVERY_S)
    pieces = [error[n : n + samples] for n in range(0, len(error), samples)]
    return [piece for piece in pieces if np.isfinite(piece).sum() >= budgets.hour_share_min * samples]


def _figure(measure: tuple[str, str, float], seen: _Seen, budgets: Budgets) -> Figure:
    name, unit, budget = measure
    power = 1.0 if name.startswith("mae") else 2.0
    is_hour = name.endswith("_worst_hour")
    error = max(seen.pieces, key=lambda piece: _error(piece, power), default=seen.error[:0]) if is_hour else seen.error
    count = int(np.isfinite(error).sum())
    told = count * EVERY_S / HOUR_S
    if not count or seen.hours < budgets.hours_min:
        share = f", and {100 * budgets.hour_share_min:g} % of one hour" if is_hour else ""
        least = f"{seen.hours:.2g} h were seen; {budgets.hours_min:g} h are needed{share}"
        few = Figure(
            QUANTITY, name, unit, budget, Verdict.TOO_LITTLE, samples=count, hours=seen.hours, basis=seen.basis, reason=least
        )
        return replace(few, hours_needed=budgets.hours_min if seen.hours < budgets.hours_min else None)
    found = _interval(error, power)
    verdict = judged(found.value, budget)
    return Figure(
        QUANTITY, name, unit, budget, verdict, found.value, found.low, found.high, count, told, found.blocks, basis=seen.basis
    )


def _error(error: Floats, power: float) -> float:
    return float(np.nanmean(np.abs(error) ** power) ** (1.0 / power))


def _interval(error: Floats, power: float) -> Interval:
    size = np.abs(error) ** power
    sums = block_sums(np.column_stack([size, np.where(np.isfinite(size), 1.0, np.nan)]), block_samples(size))
    return bootstrapped(sums, lambda s: (s[:, 0] / s[:, 1]) ** (1.0 / power))
