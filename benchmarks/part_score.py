"""The cost of a machine's tick with the scores of parts, beside a plain fold over the same ticks that only keeps the last row.

    .venv/bin/python benchmarks/part_score.py --days 2 --machines 4

A cell of machines learns for some days and is followed through the next one; the time of following, judging beside the peers and
learning is that of all ticks, standing ones included, and of those that cut alone. Times are of the process, median of the hours.
"""

import argparse
import time
from collections.abc import Sequence
from statistics import median

import numpy as np

from benchmarks.simulated_cell.cell import draw_cell, machine_readings
from benchmarks.simulated_cell.schedule import DAY_S
from benchmarks.simulated_cell.signals import FEATURES
from twin.anomaly.gate import gate
from twin.anomaly.parts.following import told_after
from twin.anomaly.parts.judging import judged
from twin.anomaly.parts.learning import learned
from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.own import Own, begun
from twin.anomaly.parts.replay import Recorded, fit
from twin.anomaly.parts.told import Told

TAIL_S = 8.0
HOUR = 3600


def cell_of(seed: int, machines: int, days: int) -> list[Recorded]:
    """Return a cell without faults as recorded."""
    cell = draw_cell(seed, machines, days, days)
    found = []
    for place, schedule in enumerate(cell.schedules):
        override = schedule.feed_override_pct.astype(np.float64)
        found.append(
            Recorded(
                f"m{place}",
                1.0,
                FEATURES,
                machine_readings(cell, place).rows,
                schedule.names,
                schedule.program.astype(np.int64),
                schedule.tool_number.astype(np.int64),
                schedule.nc_line.astype(np.int64),
                override,
                np.full(len(override), np.nan),
                gate(schedule.tool_change_active, 1.0, TAIL_S),
            )
        )
    return found


def plain(ticks: Sequence[Sequence[Told]]) -> float:
    """Return the seconds that a fold takes which keeps the last row of each machine."""
    began = time.process_time()
    states: list[tuple[int, Sequence[float | None]]] = [(0, ())] * len(ticks[0])
    for row in ticks:
        for place, told in enumerate(row):
            states[place] = (told.tick, told.values)
    return time.process_time() - began


def scored(models: Sequence[PartsModel], owns: list[Own], ticks: Sequence[Sequence[Told]]) -> tuple[float, float]:
    """Return the seconds of following, judging and learning, all ticks' and those at which the machine cuts."""
    clock, cutting, began = time.process_time, 0.0, time.process_time()
    for row in ticks:
        tick_began = clock()
        for place, told in enumerate(row):
            owns[place] = told_after(models[place], owns[place], told)
        before = tuple(owns)
        for place, model in enumerate(models):
            now = judged(model, before[place], (*before[:place], *before[place + 1 :]))
            owns[place], _ = learned(model, before[place], now, False)
        if not any(own.is_idle for own in owns):
            cutting += clock() - tick_began
    return clock() - began, cutting


def main() -> None:
    """Prints µs a machine tick, and how many plain folds that is."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--machines", type=int, default=4)
    asked.add_argument("--days", type=int, default=2, help="days to learn from; the next one is followed")
    given = asked.parse_args()
    cell = cell_of(given.seed, given.machines, given.days + 1)
    models = fit([one.until(given.days * DAY_S) for one in cell])
    owns = [begun(model) for model in models]
    every, alone, simple = [], [], []
    for hour in range(24):
        begins = given.days * DAY_S + hour * HOUR
        told = zip(*(one.between(begins, begins + HOUR).told() for one in cell), strict=True)
        ticks = [[one for one in row if one is not None] for row in told]
        simple.append(plain(ticks) / (HOUR * given.machines))
        seconds, cutting = scored(models, owns, ticks)
        every.append(seconds / (HOUR * given.machines))
        count = sum(not any(own.is_idle for own in row) for row in [owns]) and cutting
        alone.append(count)
    print(f"{given.machines} machines, {24 * HOUR * given.machines} machine ticks of a working day")
    print(f"a tick: {1e6 * sum(every) / 24:.1f} us, busiest hour {1e6 * max(every):.1f} us, median {1e6 * median(every):.1f} us")
    print(f"a plain fold: {1e6 * sum(simple) / 24:.2f} us; ratio {sum(every) / sum(simple):.0f}")


if __name__ == "__main__":
    main()
