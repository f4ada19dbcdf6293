"""Live plants under seeds: a whole plant in one process on one clock, with the faults that each seed draws, and judge them.

    .venv/bin/python benchmarks/plant_seeds.py --seeds 200 --start 1000            # two processes; what they ran and found
    .venv/bin/python benchmarks/plant_seeds.py --replay 1017                       # one seed, twice, with fewer and fewer faults
    .venv/bin/python benchmarks/plant_seeds.py --seeds 40 --defect claim-unseen    # how soon a defect put back in is found

docs/explanation/plant-simulation.md says what is simulated, what has to hold, and what is not modelled.
"""

import argparse
import logging
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.plant.simulation.defects import DEFECTS
from tests.plant.simulation.run import Result, invariant_of, lived, shrunk

PROCESSES = 2


def run(seed: int, defect: str | None) -> tuple[Result, float]:
    """Run one seed; with the seconds of a processor that it took."""
    logging.disable(logging.CRITICAL)
    began_s = time.process_time()
    return lived(seed, defect=defect), time.process_time() - began_s


def results(seeds: range, defect: str | None, processes: int) -> Iterator[tuple[Result, float]]:
    """Run seeds in several processes; yield what each came to, in their order."""
    if processes == 1:
        yield from (run(seed, defect) for seed in seeds)
        return
    with ProcessPoolExecutor(processes) as pool:
        yield from pool.map(run, seeds, [defect] * len(seeds), chunksize=4)


def survey(seeds: range, defect: str | None, processes: int) -> int:
    """Run seeds, and print what was run and what was violated; 1 where something was."""
    began_s = time.monotonic()
    injected, violated = Counter[str](), Counter[str]()
    failed: list[int] = []
    events = busy_s = lived_s = notified = 0.0
    for result, took_s in results(seeds, defect, processes):
        injected += result.injected
        events, busy_s, lived_s, notified = (
            events + result.events,
            busy_s + took_s,
            lived_s + result.seconds,
            notified + result.notified,
        )
        if result.violations:
            failed.append(result.seed)
            violated.update({invariant_of(violation) for violation in result.violations})
            print(result.report, flush=True)
    took_s = time.monotonic() - began_s
    print(
        f"seeds            {len(seeds)} ({seeds.start} to {seeds.stop - 1})" + (f", with the defect {defect}" if defect else "")
    )
    print(f"plant time       {lived_s / 3600:.2f} h, {events:.0f} events, {notified:.0f} notifications arrived")
    print(f"faults           {injected.total()}: " + ", ".join(f"{kind} {count}" for kind, count in sorted(injected.items())))
    print(f"violations       {len(failed)} seeds: {dict(violated)}")
    if failed:
        print(f"first            seed {failed[0]}, the {failed[0] - seeds.start + 1}. that was run")
    an_hour, each_s = len(seeds) / took_s * 3600, busy_s / len(seeds)
    print(f"seeds an hour    {an_hour:.0f} in {processes} processes, {each_s:.2f} s of a processor each")
    return 1 if failed and defect is None else 0


def replay(seed: int, defect: str | None) -> int:
    """Run one seed twice, then with fewer and fewer faults."""
    first, _ = run(seed, defect)
    print(first.report)
    again, _ = run(seed, defect)
    print(f"  again      {'the same' if again.digest == first.digest else 'ANOTHER'} hash {again.digest}")
    if first.violations:
        print("with as few faults as show it:")
        print(shrunk(first, defect).report)
    return 1 if first.violations or again.digest != first.digest else 0


def main() -> int:
    """Read the options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=100, help="how many")
    parser.add_argument("--start", type=int, default=1, help="the first one")
    parser.add_argument("--replay", type=int, help="run this one, and find the fewest faults that show the same")
    parser.add_argument("--defect", choices=sorted(DEFECTS), help="put a defect back in")
    parser.add_argument("--processes", type=int, default=min(PROCESSES, os.cpu_count() or 1))
    options = parser.parse_args()
    if options.replay is not None:
        return replay(options.replay, options.defect)
    return survey(range(options.start, options.start + options.seeds), options.defect, options.processes)


if __name__ == "__main__":
    raise SystemExit(main())
