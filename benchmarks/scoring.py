"""Which faults are found on the simulated cell, at one false alert a machine-week, by which method; with intervals.

    .venv/bin/python benchmarks/scoring.py --seeds 101-106 --machines 4 --jobs 2
    .venv/bin/python benchmarks/scoring.py --seeds 101 --machines 4 --parts     # also by kind of fault, by size, by occasion
    .venv/bin/python benchmarks/scoring.py --fast --methods parts --parts       # seed 1, two days each, to develop

Models learn on week A, thresholds are fitted on week B (no faults in either; as many disturbances), week C with faults is judged,
for each machine by itself, as `cnctwin train anomaly` does. The cell (benchmarks/simulated_cell) is cut by the reference machine,
which shares no code with the twin; a control tells of it once a second. Methods:

    parts            cuts beside the same cut of earlier parts and beside the twin, less what peers share (twin/anomaly/parts)
    parts -part      no baseline of parts: beside the twin only;  -twin, -peers, -gates: without these
    features, own features, residual, source f, gate, plain, random, constant, vibration: benchmarks/scored/frames.py
    ecod, loda, adwin, page_hinkley …: benchmarks/scored/detectors.py

Size 1 of a fault is stated in benchmarks/simulated_cell/fault.py, and was before anything was judged. Seeds 1 to 3 were used to
develop the methods; others are for reporting. Nothing is point-adjusted (benchmarks/evaluation).
"""

import argparse
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np

from benchmarks.scored import frames as by_frames
from benchmarks.scored.judged import Judged
from benchmarks.scored.parts import ABLATIONS, judged_parts, recorded
from benchmarks.scored.shown import sizes_shown
from benchmarks.scored.table import details, row
from benchmarks.simulated_cell.cell import draw_cell

METHODS = (*ABLATIONS, *by_frames.METHODS)
FAST = ("1", "2,2,2")


class Asked(NamedTuple):
    """One cell and the methods to judge it by."""

    seed: int
    machines: int
    days: tuple[int, int, int]
    methods: tuple[str, ...]
    alerts_per_week: float


class Answer(NamedTuple):
    """judged: by method, a machine after another; took_s: by method, with the training."""

    judged: dict[str, list[Judged]]
    took_s: dict[str, float]


def answer(asked: Asked) -> Answer:
    """Judge a cell by all methods."""
    train, calibrate, judge = asked.days
    cell = draw_cell(asked.seed, asked.machines, train + calibrate + judge, train + calibrate)
    found: dict[str, list[Judged]] = {}
    took_s: dict[str, float] = {}
    own = [method for method in asked.methods if method in ABLATIONS]
    others = [method for method in asked.methods if method not in ABLATIONS]
    recordings = [recorded(cell, place) for place in range(asked.machines)] if own else []
    for method in own:
        began = time.perf_counter()
        found[method] = judged_parts(cell, asked.days, recordings, ABLATIONS[method], asked.alerts_per_week)
        took_s[method] = time.perf_counter() - began
    framed = by_frames.framed(cell, asked.days) if others else None
    for method in others:
        assert framed is not None
        began = time.perf_counter()
        found[method] = by_frames.judged(framed, method, asked.alerts_per_week)
        took_s[method] = time.perf_counter() - began
    return Answer({method: found[method] for method in asked.methods}, took_s)


def printed(machines: int, seeds: str, answers: Sequence[Answer], methods: Sequence[str], *, has_parts: bool) -> None:
    """Print the table of a size of cell, and how big the faults are beside normal variation."""
    every = {method: [one for found in answers for one in found.judged[method]] for method in methods}
    lines = {method: row(results, np.random.default_rng(0)) for method, results in every.items()}
    print(f"\n{machines} machines, seeds {seeds}; intervals of 90 %")
    names = list(next(iter(lines.values())))
    print("| method | " + " | ".join(names) + " |\n|" + "---|" * (len(names) + 1))
    for method, line in lines.items():
        print(f"| {method} | " + " | ".join(line.values()) + " |")
    took = ", ".join(f"{method} {sum(found.took_s[method] for found in answers):.0f} s" for method in methods)
    print(f"took: {took}")
    for method, results in every.items() if has_parts else ():
        print(method, *details(results), sep="\n")
    sys.stdout.flush()


def print_sizes(seed: int) -> None:
    """Print how big size 1 is beside what healthy parts do."""
    shown = ", ".join(f"{kind} {size:.1f}" for kind, size in sizes_shown(seed).items())
    print(f"size 1 in spreads of a pass from part to part, seed {seed}: {shown}")


def main() -> None:
    """Prints the table for each number of machines."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--seeds", default="101-106")
    asked.add_argument("--machines", default="2,4,12")
    asked.add_argument("--methods", default=",".join(METHODS))
    asked.add_argument("--days", default="7,7,7")
    asked.add_argument("--alerts", type=float, default=1.0, help="false alerts a machine-week that are asked for")
    asked.add_argument("--parts", action="store_true", help="also by kind of fault, and by occasion")
    asked.add_argument("--jobs", type=int, default=1)
    asked.add_argument("--fast", action="store_true", help="seed 1, four machines, two days each")
    asked.add_argument("--sizes", action="store_true", help="print only how big size 1 is")
    given = asked.parse_args()
    if given.fast:
        given.seeds, given.days = FAST
        given.machines = "4"
    first, _, last = given.seeds.partition("-")
    train, calibrate, judge = (int(days) for days in given.days.split(","))
    if given.sizes:
        print_sizes(int(first))
        return
    methods = tuple(given.methods.split(","))
    for machines in map(int, given.machines.split(",")):
        cells = [
            Asked(seed, machines, (train, calibrate, judge), methods, given.alerts)
            for seed in range(int(first), int(last or first) + 1)
        ]
        if given.jobs > 1:
            with ProcessPoolExecutor(given.jobs) as pool:
                answers = list(pool.map(answer, cells))
        else:
            answers = [answer(one) for one in cells]
        printed(machines, given.seeds, answers, methods, has_parts=given.parts)


if __name__ == "__main__":
    main()
