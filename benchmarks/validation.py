#!/usr/bin/env python3
"""Measure how often the nightly validation and the model registry are wrong, where the truth is known.

    .venv/bin/python benchmarks/validation.py [--cases 1000] [--json]

* intervals: how often the 95 % interval of a mean over a day holds the truth, for errors that remember minutes to hours
* equal challenger: how often one that is as good as the champion wins a day's holdout; at most 5 % are to
* better challenger: how often one whose squared error is smaller wins
* nights: calls for retraining in a year of a twin that is the same all the time, by the median of its worst hour's rms error over
  the budget; beside it how often one night over budget would have called. Errors have a memory of an hour, nights differ (parts,
  surroundings) by 15 %
* clock: how often a truth that has nothing to do with the machine is placed on its clock, and one that has is placed wrongly

All series are made here; a row each ten seconds, as the residual's losses and the nightly temperatures are.
"""

import argparse
import json
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from cnctwin.challenge.contest import Losses, outcome
from cnctwin.validation.block_bootstrap import block_samples, block_sums, bootstrapped
from cnctwin.validation.clock import Clock, Pair, placed
from cnctwin.validation.history import retraining
from cnctwin.validation.track import Track

Floats = NDArray[np.float64]
DAY, HOUR = 8640, 360
MEMORIES_S = (60.0, 600.0, 1800.0, 3600.0)
GAINS = (0.05, 0.1, 0.2, 0.4)
SIZES = (0.6, 0.7, 0.8, 0.9, 1.0)
NIGHT_SPREAD = 0.15
YEARS = 20


def remembered(rng: np.random.Generator, memory_s: float, count: int = DAY) -> Floats:
    """Errors (count,) of unit variance that forget in `memory_s`."""
    keep = float(np.exp(-10.0 / memory_s))
    start = rng.standard_normal() * keep
    shocks = np.sqrt(1.0 - keep**2) * rng.standard_normal(count)
    return np.asarray(lfilter([1.0], [1.0, -keep], shocks, zi=[start])[0])


def intervals(cases: int) -> Iterator[dict[str, float]]:
    """Coverage by memory; a case without an interval (too few blocks) is counted apart."""
    for memory_s in MEMORIES_S:
        held = none = 0
        for case in range(cases):
            error = remembered(np.random.default_rng([1, case]), memory_s)
            found = bootstrapped(block_sums(np.column_stack([error, np.ones(DAY)]), block_samples(error)), _mean, draws=300)
            if found.low is None or found.high is None:
                none += 1
            else:
                held += found.low <= 0.0 <= found.high
        yield {"memory_s": memory_s, "coverage": held / max(cases - none, 1), "without_interval": none / cases}


def _mean(sums: Floats) -> Floats:
    return np.asarray(sums[:, 0] / sums[:, 1])


def wins(cases: int, gain: float) -> Iterator[dict[str, float]]:
    """Return how often a challenger wins whose mean squared error is smaller by `gain`; half of its error is the champion's."""
    for memory_s in MEMORIES_S:
        won = 0
        for case in range(cases):
            rng = np.random.default_rng([2, case])
            shared, own, other = (remembered(rng, memory_s) for _ in range(3))
            champion = (shared + own) ** 2 / 2.0
            challenger = (1.0 - gain) * (shared + other) ** 2 / 2.0
            won += outcome(Losses(champion, challenger, 10.0), None, hours_min=23.9).wins
        yield {"gain": gain, "memory_s": memory_s, "wins": won / cases}


def nights() -> Iterator[dict[str, float]]:
    """Calls a year, by the median of the worst hour's rms error over its budget."""
    rng = np.random.default_rng(3)
    worst = np.array([_worst_hour(rng) for _ in range(365 * YEARS)])
    worst /= np.median(worst)
    for size in SIZES:
        over = (size * worst > 1.0).tolist()
        known = [_night(number, is_over) for number, is_over in enumerate(over)]
        calls = [retraining(known[max(0, n - 1) : n + 1]) is not None for n in range(len(known))]
        begun = sum(now and not before for before, now in zip([False, *calls], calls, strict=False))
        yield {
            "size": size,
            "nights_over": float(np.mean(over)),
            "one_night_a_year": sum(over) / YEARS,
            "calls_a_year": begun / YEARS,
        }


def _worst_hour(rng: np.random.Generator) -> float:
    error = remembered(rng, 3600.0) * np.exp(NIGHT_SPREAD * rng.standard_normal())
    return float(np.sqrt((error.reshape(-1, HOUR) ** 2).mean(axis=1)).max())


def _night(number: int, is_over: bool) -> dict[str, object]:
    figure = {"quantity": "temperature", "measure": "rmse_worst_hour", "verdict": "over" if is_over else "within"}
    return {"night": f"{number:06d}", "twin": "a", "figures": [figure]}


def clocks(cases: int) -> dict[str, float]:
    """A truth of an hour beside a day: one that is unrelated, one that is related with a correlation of about 0.8."""
    strange = wrong = none = 0
    for case in range(cases):
        rng = np.random.default_rng([4, case])
        machine = Track(10.0 * np.arange(DAY), remembered(rng, 120.0))
        unrelated = Track(10.0 * np.arange(HOUR), remembered(rng, 120.0, HOUR))
        strange += isinstance(placed([Pair("load", unrelated, machine)], 0.0, 86_400.0, 10.0, (-9e4, 9e4)), Clock)
        start = int(rng.integers(0, DAY - HOUR))
        noise = 0.75 * rng.standard_normal(HOUR)
        related = Track(10.0 * np.arange(HOUR), machine.value[start : start + HOUR] + noise)
        found = placed([Pair("load", related, machine)], 0.0, 86_400.0, 10.0, (-9e4, 9e4))
        none += not isinstance(found, Clock)
        wrong += isinstance(found, Clock) and abs(found.offset_s - 10.0 * start) > 20.0
    return {"unrelated_placed": strange / cases, "placed_wrongly": wrong / cases, "not_placed": none / cases}


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    told = {
        "intervals": list(intervals(asked.cases)),
        "equal": list(wins(asked.cases, 0.0)),
        "better": [one for gain in GAINS for one in wins(max(asked.cases // 5, 1), gain)],
        "nights": list(nights()),
        "clock": clocks(max(asked.cases // 5, 1)),
    }
    if asked.json:
        print(json.dumps(told))
        return
    for name, table in told.items():
        print(f"\n{name}")
        for row in table if isinstance(table, list) else [table]:
            print("  " + ", ".join(f"{key} {value:.4g}" for key, value in row.items()))


if __name__ == "__main__":
    main()
