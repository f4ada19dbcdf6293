"""The parts left of tools that wear, how soon a tool that wears too fast is told, and false alarms a year.

    .venv/bin/python -m benchmarks.worn_tools.parts_left --seeds 101-106 --days 60
    .venv/bin/python -m benchmarks.worn_tools.parts_left --seeds 101-106 --days 60 --fast 3    # one life in five is fast

The machine is benchmarks/worn_tools/world.py, on the reference machine of the blind check. Seeds 1 to 12 were used to develop,
101 to 106 are for the report. Lives count from the third of a tool on. Nothing is fitted on what is judged: lives before are
all the model knows.
"""

import argparse
import time
from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.evaluation.intervals import rate, share
from benchmarks.worn_tools.world import Part, World
from twin.wear.machine import Wear, cut_added
from twin.wear.status import status_of
from twin.wear.terms import Terms

SHARES = (0.25, 0.5, 0.75)
YEAR_DAYS = 365.25
MARKS = tuple(number / 20 for number in range(1, 20))


class Forecast(NamedTuple):
    """The parts left of a tool as they were given at a share of its life, and as they came."""

    share: float
    left: int
    low: float | None
    middle: float
    high: float
    life_uses: int
    mean_uses: float


class FastLife(NamedTuple):
    """A life by when it was first told to wear too fast (None = never), how long it was, and whether it does."""

    told: int | None
    uses: int
    is_fast: bool


class Result(NamedTuple):
    """The findings of one history."""

    forecasts: tuple[Forecast, ...]
    lives: tuple[FastLife, ...]
    replacements: tuple[int, int, int]
    first_uses: tuple[int, ...]
    days: float
    us_per_cut: float


def played(seed: int, days: float, fast: float, terms: Terms) -> Result:
    """Play a history and judge it."""
    parts = list(World(seed, fast=fast).parts(days))
    length = lives_of(parts)
    wanted = {
        (tool, life, max(int(uses * mark), 1)): mark
        for (tool, life), (uses, is_over) in length.items()
        if is_over
        for mark in SHARES
    }
    wear, spent_s, cuts = Wear(), 0.0, 0
    forecasts: list[Forecast] = []
    first: dict[tuple[int, int], int] = {}
    told: dict[tuple[int, int], int] = {}
    is_fast: dict[tuple[int, int], bool] = {}
    replacements: dict[str, list[int]] = defaultdict(list)
    for before, part in zip([None, *parts], parts, strict=False):
        begin = time.perf_counter()
        for cut in part.cuts:
            wear, _ = cut_added(wear, cut, terms)
        spent_s, cuts = spent_s + time.perf_counter() - begin, cuts + len(part.cuts)
        for truth in () if before is None else before.tools:
            name, key = str(truth.tool), (truth.tool, truth.life)
            tool = wear.tools[name]
            is_fast[key] = truth.is_fast
            if tool.is_fast and key not in told and truth.uses > 3:
                told[key] = truth.uses
            if tool.replaced_part >= 0 and tool.replaced_part not in replacements[name][-1:]:
                replacements[name].append(tool.replaced_part)
            mark = wanted.get((*key, truth.uses))
            if mark is None and key in first:
                continue
            status = status_of(name, tool, wear, terms)
            if status.left is not None and key not in first and tool.uses <= truth.uses:
                first[key] = truth.uses
            if mark is not None and len(tool.lives) >= 2 and not truth.is_fast:
                uses = length[key][0]
                given = status.left
                low, middle, high = (None, 0.0, 0.0) if given is None else (given.low, given.middle, given.high)
                mean = float(np.mean([life.uses for life in tool.lives]))
                forecasts.append(Forecast(mark, uses - truth.uses, low, middle, high, uses, mean))
    lives = tuple(
        FastLife(told.get(key), uses, is_fast.get(key, False)) for key, (uses, over) in length.items() if over and key[1] >= 3
    )
    true_at = defaultdict(list)
    for part in parts:
        for truth in part.tools:
            if truth.is_replaced:
                true_at[str(truth.tool)].append(part.number + 1)
    return Result(
        tuple(forecasts), lives, matched(true_at, replacements), tuple(uses for (_, life), uses in first.items() if life >= 3),
        days, 1e6 * spent_s / cuts,
    )  # fmt: skip


def lives_of(parts: Sequence[Part]) -> dict[tuple[int, int], tuple[int, bool]]:
    """Return each life by tool and number: its uses, and whether it ended within the history."""
    found: dict[tuple[int, int], tuple[int, bool]] = {}
    for part in parts:
        for truth in part.tools:
            found[truth.tool, truth.life] = (truth.uses, truth.is_replaced)
    return found


def matched(true_at: dict[str, list[int]], found_at: dict[str, list[int]]) -> tuple[int, int, int]:
    """Return replacements: how many there were, how many were found (within 90 parts of all), and how many were made up."""
    there = sum(map(len, true_at.values()))
    hits = sum(any(abs(one - other) <= 90 for other in found_at[name]) for name, own in true_at.items() for one in own)
    made_up = sum(all(abs(one - other) > 90 for other in true_at[name]) for name, own in found_at.items() for one in own)
    return there, hits, made_up


def table(results: Sequence[Result]) -> str:
    """Return the table of the parts left."""
    forecasts = [one for result in results for one in result.forecasts]
    lines = [
        "| at | lives | given | error, median, % of life | by mean life alone | in the band of 90 % | half band, % of life |",
        "|---|---|---|---|---|---|---|",
    ]
    for mark in SHARES:
        own = [one for one in forecasts if one.share == mark]
        given = [one for one in own if one.low is not None]
        if not given:
            continue
        error = float(np.median([abs(one.middle - one.left) / one.life_uses for one in given]))
        naive = float(
            np.median([abs(max(one.mean_uses - (one.life_uses - one.left), 0.0) - one.left) / one.life_uses for one in own])
        )
        inside = share(sum((one.low or 0.0) - 1.0 <= one.left <= one.high + 1.0 for one in given), len(given))
        half = float(np.median([(one.high - (one.low or 0.0)) / 2.0 / one.life_uses for one in given]))
        lines.append(
            f"| {mark:.0%} | {len(own)} | {len(given)} | {100 * error:.1f} | {100 * naive:.1f} | {inside} | {100 * half:.1f} |"
        )
    return "\n".join(lines)


def words(results: Sequence[Result], fast: float) -> str:
    """Return the rest in sentences."""
    lives = [one for result in results for one in result.lives]
    years = sum(result.days for result in results) / YEAR_DAYS
    false = [one for one in lives if one.told is not None and not one.is_fast]
    true = [one for one in lives if one.is_fast]
    there, hits, made_up = (sum(result.replacements[place] for result in results) for place in range(3))
    first = [uses for result in results for uses in result.first_uses]
    lines = [
        f"replacements: {there}, found {share(hits, there)}, made up {made_up}",
        f"false alarms of a tool that wears fast, a machine and year: {rate(len(false), years)} ({len(false)} in {years:.2f})",
        f"parts of a life before parts left are given: median {np.median(first):.0f}, 90 % by {np.quantile(first, 0.9):.0f}"
        if first
        else "parts left are never given",
        f"cost: {np.median([result.us_per_cut for result in results]):.0f} us a cut record",
    ]
    if true:
        told = [one for one in true if one.told is not None]
        at = [100.0 * (one.told or 0) / one.uses for one in told]
        lines.append(
            f"lives {fast:g} times as fast: {len(true)}, told {share(len(told), len(true))}, "
            f"after {np.median([one.told or 0 for one in told]):.0f} parts or {np.median(at):.0f} % of the life (medians)"
            if told
            else f"lives {fast:g} times as fast: {len(true)}, none told"
        )
    return "\n".join(lines)


def seeds_of(text: str) -> list[int]:
    """Return the seeds of `101-106` or `3`."""
    first, _, last = text.partition("-")
    return list(range(int(first), int(last or first) + 1))


def main() -> None:
    """Print tables and sentences."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", default="101-106", type=seeds_of)
    parser.add_argument("--days", default=60.0, type=float)
    parser.add_argument("--fast", default=0.0, type=float)
    given = parser.parse_args()
    results = [played(seed, given.days, given.fast, Terms()) for seed in given.seeds]
    print(table(results))
    print(words(results, given.fast))


if __name__ == "__main__":
    main()
