"""The drift of a machine by the load that all tools share: how soon it is told, and false alarms a year, by several charts.

    .venv/bin/python -m benchmarks.worn_tools.drift --seeds 101-106 --days 150

The machine is benchmarks/worn_tools/world.py; its meter drifts by 6 % within four weeks from day 60 on. The figures are the
blocks of processors/tool_wear/drift.py, the same for all charts. river's ADWIN and PageHinkley are in the table where river is
installed (it is no dependency), as it gives them and over a grid of thresholds: charts are compared in rows of the same rate of
false alarms. No threshold is chosen on what is judged. Each alarm begins the chart again; those of the blocks that are learned
count for none.
"""

import argparse
import importlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks.evaluation.intervals import rate, share
from benchmarks.worn_tools.parts_left import YEAR_DAYS, seeds_of
from benchmarks.worn_tools.world import World
from processors.tool_wear.config import Config
from processors.tool_wear.drift import Drift, after_part
from twin.wear.machine import Wear, cut_added

FROM_DAY = 60.0
Blocks = list[tuple[float, float, int]]
"""For each block: the day of its end, its figure, and how the chart of the gap judges it."""


def blocks_of(seed: int, days: float, from_day: float, config: Config) -> Blocks:
    """Return the blocks of a history."""
    wear, drift, found = Wear(), Drift(), []
    for part in World(seed, drift_from_day=from_day).parts(days):
        for cut in part.cuts:
            wear, is_judged = cut_added(wear, cut, config.terms)
            before = drift
            drift = after_part(config, drift, wear) if is_judged else drift
            if drift.last is not None and drift.block != before.block and before.parts >= config.block_parts_min:
                found.append((part.day, drift.last, drift.chart.grows))
    return found


def of_the_gap(blocks: Blocks, _: int) -> list[float]:
    """Return the days on which our chart begins to alarm."""
    return [day for before, (day, _, grows) in zip([(0.0, 0.0, 0), *blocks], blocks, strict=False) if grows and not before[2]]


def of_river(make: Callable[[], Any]) -> Callable[[Blocks, int], list[float]]:
    """Return how a detector of river judges blocks, in units of their healthy spread."""

    def judged(blocks: Blocks, healthy: int) -> list[float]:
        first = np.array([figure for _, figure, _ in blocks[:healthy]])
        detector, found = make(), []
        for day, figure, _ in blocks[healthy // 2 :]:
            detector.update((figure - first.mean()) / first.std())
            if detector.drift_detected:
                found.append(day)
        return found

    return judged


def charts() -> dict[str, Callable[[Blocks, int], list[float]]]:
    """Return the charts that are compared."""
    found = {"chart of the gap": of_the_gap}
    try:
        drift = importlib.import_module("river.drift")
    except ImportError:
        print("river is not installed: ADWIN and PageHinkley are left out")
        return found
    found["ADWIN, as given"] = of_river(drift.ADWIN)
    found["PageHinkley, as given"] = of_river(drift.PageHinkley)
    for delta in (1e-2, 1e-3, 1e-4, 1e-6):
        found[f"ADWIN, delta {delta:g}"] = of_river(lambda delta=delta: drift.ADWIN(delta=delta, clock=1, grace_period=5))
    for threshold in (10.0, 20.0, 40.0):
        found[f"PageHinkley, threshold {threshold:g}"] = of_river(
            lambda threshold=threshold: drift.PageHinkley(threshold=threshold, delta=0.25)
        )
    return found


def table(healthy: Sequence[Blocks], drifting: Sequence[Blocks], days: float, config: Config) -> str:
    """Return the table."""
    lines = ["| chart | false alarms a machine and year | told | days after it began, median |", "|---|---|---|---|"]
    for name, judged in charts().items():
        learned = [blocks[config.healthy_blocks - 1][0] for blocks in healthy]
        false = sum(
            sum(day > first for day in judged(blocks, config.healthy_blocks))
            for blocks, first in zip(healthy, learned, strict=True)
        )
        years = sum(max(days - first, 0.0) for first in learned) / YEAR_DAYS
        delays = []
        for blocks in drifting:
            after = [day - FROM_DAY for day in judged(blocks, config.healthy_blocks) if day > FROM_DAY]
            delays += after[:1]
        middle = f"{np.median(delays):.0f}" if delays else "–"
        lines.append(f"| {name} | {rate(false, years)} | {share(len(delays), len(drifting))} | {middle} |")
    return "\n".join(lines)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", default="101-106", type=seeds_of)
    parser.add_argument("--days", default=150.0, type=float)
    given = parser.parse_args()
    config = Config()
    healthy = [blocks_of(seed, given.days, -1.0, config) for seed in given.seeds]
    drifting = [blocks_of(seed, min(given.days, FROM_DAY + 60.0), FROM_DAY, config) for seed in given.seeds]
    print(table(healthy, drifting, given.days, config))


if __name__ == "__main__":
    main()
