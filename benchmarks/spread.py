#!/usr/bin/env python3
"""One optimisation in this process, in two processes, and on a Dask cluster of two workers, one of which is killed on the way.

    .venv/bin/python benchmarks/spread.py [--levels N] [--islands N] [--evolutions N] [--population N] [--repeats N] [--json]

The search of `cnctwin optimise` in its real pieces: an island of the population, ten evolutions on. All ways are taken in the
same run, each after a first piece that loads and compiles; scheduler and workers are processes of their own (`dask scheduler`,
`dask worker` without the nanny that would start another one), and the killed one gets SIGKILL while it computes. Its share is
computed by the other one. The answer is compared whole: program, every figure of every line, history of the search, all but how
long it took.

Each way counts with its least time of some repeats, since a machine is never quiet. The islands of an epoch wait for each other,
and reading, rewriting and judging the program is not spread: seconds are of the search alone, beside those of all. All have one
thread of linear algebra a process.
"""

import argparse
import json
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}

from cnctwin.jobs.dask_cluster import DaskCluster
from cnctwin.jobs.spread import Spread, spread_over
from tests.cnctwin.jobs.dask_processes import DaskProcesses, dask_processes
from twin.optimisation.answer import Objective, Optimised
from twin.optimisation.optimise import Hooks, optimise
from twin.optimisation.question import Question

MACHINE = (
    Path(__file__).with_name("simulator_machine.toml").read_text(encoding="utf-8")
    + """
spindle_acceleration_rpm_s = 5000.0
[stock]
min_mm = [0.0, 0.0, -30.0]
max_mm = [120.0, 90.0, 0.0]
[limits]
feed_mm_min = [100.0, 4000.0]
spindle_rpm = [1000.0, 8000.0]
force_n = 600.0
[cost]
currency = "EUR"
tool_price = 60.0
tool_change_s = 30.0
labour_per_s = 0.012
depreciation_per_s = 0.008
taylor_c_m_per_min = 400.0
taylor_n = 0.25
"""
)
PASSES = 8
KILL_S = 0.1


@dataclass(frozen=True, slots=True)
class Row:
    """seconds: of the search; whole_s: with reading, rewriting and judging; killed: workers; same: the first way's answer"""

    way: str
    seconds: float
    whole_s: float
    pieces: int
    killed: int
    same: bool


def question(levels: int = 5, islands: int = 4, evolutions: int = 50, population: int = 96) -> Question:
    """A block milled in levels, two lines a pass."""
    lines = ["G21 G17 G90 G94 G54", "S3000 M3", "G0 Z5."]
    for level in range(levels):
        for number in range(PASSES):
            lines += [f"G0 X-15. Y{4 + 6 * number}.", f"G0 Z{-1.0 - 1.5 * level}", "G1 X60. F600", "G1 X135.", "G0 Z5."]
    text = "\n".join([*lines, "M30", ""])
    options = {"islands": islands, "evolutions": evolutions, "population": population}
    return Question(text, MACHINE, objective=Objective.COST, **options)  # type: ignore[arg-type]


class Watched:
    """A spread that counts pieces and seconds, and calls `at_epoch` a moment after an epoch has begun."""

    def __init__(self, spread: Spread, at_epoch: Callable[[], None] | None = None, epoch: int = 2) -> None:
        self._spread, self._at_epoch, self._epoch = spread, at_epoch, epoch
        self.epochs, self.pieces, self.seconds = 0, 0, 0.0

    def __call__(self, function: Callable[[str], str], texts: Sequence[str]) -> Iterator[str]:
        """As `Spread`."""
        self.epochs += 1
        if self.epochs == self._epoch and self._at_epoch is not None:
            threading.Timer(KILL_S, self._at_epoch).start()
        began_s = time.perf_counter()
        for answer in self._spread(function, texts):
            self.pieces += 1
            yield answer
        self.seconds += time.perf_counter() - began_s


def measured(asked: Question, repeats: int) -> Iterable[Row]:
    """Each way in turn."""
    optimise(asked.with_(evolutions=0), resimulate=False)
    first: list[Optimised] = []

    def one(way: str, watched: Watched, killed: int = 0) -> Row:
        began_s = time.perf_counter()
        found = optimise(asked, Hooks(spread=watched), resimulate=False)
        first.append(found)
        whole_s = time.perf_counter() - began_s
        return Row(way, watched.seconds, whole_s, watched.pieces, killed, told(found) == told(first[0]))

    def best(rows: list[Row]) -> Row:
        least = min(rows, key=lambda row: row.seconds)
        return replace(least, whole_s=min(row.whole_s for row in rows), same=all(row.same for row in rows))

    with spread_over() as spread:
        yield best([one("in this process", Watched(spread)) for _ in range(repeats)])
    with spread_over(workers=2) as spread:
        warm(spread, asked)
        yield best([one("two processes (joblib)", Watched(spread)) for _ in range(repeats)])
    with TemporaryDirectory() as folder, dask_processes(Path(folder)) as dask:
        cluster = DaskCluster.from_text(dask.start_scheduler())
        for _ in range(2):
            dask.start_worker(cluster.address)
        with spread_over(dask=cluster) as spread:
            wait_for_workers(dask, 2)
            warm(spread, asked)
            yield best([one("two Dask workers", Watched(spread)) for _ in range(repeats)])
            rows = []
            for repeat in range(repeats):
                victim = dask.workers[repeat]
                rows.append(one("two Dask workers, one killed", Watched(spread, victim.kill), killed=1))
                assert victim.wait(1.0) < 0, "the worker lives"
                if repeat + 1 < repeats:
                    dask.start_worker(cluster.address)
                    wait_for_workers(dask, len(dask.workers))
                    warm(spread, asked)
            yield best(rows)


def warm(spread: Spread, asked: Question) -> None:
    """Have each worker load and compile what it needs."""
    optimise(asked.with_(evolutions=0), Hooks(spread=spread), resimulate=False)


def wait_for_workers(dask: DaskProcesses, count: int) -> None:
    """Until so many are registered at the scheduler."""
    end_s = time.monotonic() + 60.0
    while (dask.folder / "dask.log").read_text().count("Register worker") < count:
        assert time.monotonic() < end_s, (dask.folder / "dask.log").read_text()
        time.sleep(0.05)


def told(found: Optimised) -> str:
    """All of an answer but how long it took."""
    document = found.as_json()
    document["search"].pop("seconds")
    return json.dumps([document, found.program], sort_keys=True)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for option, value in (("--levels", 5), ("--islands", 4), ("--evolutions", 50), ("--population", 96), ("--repeats", 3)):
        parser.add_argument(option, type=int, default=value)
    parser.add_argument("--json", action="store_true")
    given = vars(parser.parse_args())
    as_json, repeats = given.pop("json"), given.pop("repeats")
    rows = []
    if not as_json:
        print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores", flush=True)
    for row in measured(question(**given), repeats):
        rows.append(row)
        if not as_json:
            same = "the same answer" if row.same else "ANOTHER ANSWER"
            print(
                f"{row.way:32}{row.pieces:4} pieces{row.seconds:8.2f} s, with the rest{row.whole_s:8.2f} s   {same}", flush=True
            )
    if as_json:
        print(json.dumps([asdict(row) for row in rows]))
    if not all(row.same for row in rows):
        raise SystemExit("the answers differ")


if __name__ == "__main__":
    main()
