"""An hour of production over FOCAS with faults, what it has to hold, and what a look costs.

    python -m benchmarks.edges.focas [--seconds 3600] [--seeds 1 2 3]

The edge's connection, parser and pipeline read our FOCAS server over TCP; the machine's time is simulated, so an hour takes about
a minute. Prints how many looks, holes and tool changes there were, how many of each check failed, and the CPU time of a look in
the edge and in the server, with faults and without. Exit code 1 where a check failed.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterable

from cnctwin.standins.simulated_control.state import tool_changes
from tests.edge.controls.changes_told import changes_told
from tests.edge.controls.focas import hour_judged as judged
from tests.edge.controls.focas.machine_hour import SWITCHED_ON_S, Hour, run

CHECKS: tuple[Callable[[Hour], Iterable[str]], ...] = (
    judged.looks_outside_of_holes,
    judged.holes_that_are_none,
    judged.values_that_were_not_shown,
    judged.changes_told_wrongly,
    judged.changes_made_up,
    judged.tools_not_told,
    judged.tool_numbers_that_are_not_in_the_spindle,
)


def main() -> int:
    """Run the hours, print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    options = parser.parse_args()
    well = run(min(options.seconds, 600.0), 0, is_well=True)
    print(f"without faults: {_cost(well)}; {len(well.samples) / len(well.sweep_s):.1f} samples published a look")
    failed = 0
    for seed in options.seeds:
        hour = run(options.seconds, seed)
        failed += _told(hour, seed)
    return int(failed > 0)


def _told(hour: Hour, seed: int) -> int:
    true, seen = tool_changes(hour.states), judged.changes_seen(hour)
    away_s = sum(b - a for a, b in judged.holes(hour))
    faults = ", ".join(f"{number} {kind}" for kind, number in sorted(hour.kinds().items()))
    print(f"seed {seed}: {len(hour.sweep_s)} looks in {hour.sweep_s[-1]:.0f} s, {hour.reconnects} reconnects; {faults}")
    print(f"  {len(hour.gaps)} holes of {away_s:.0f} s: {_by_reason(hour)}")
    print(
        f"  {len(true)} tool changes, {len(seen)} of them outside of holes; told {len(changes_told(hour.samples, SWITCHED_ON_S))}"
    )
    received, difference = hour.ledger["ledger/received"], max(hour.differences, key=abs)
    print(f"  {received} observations received, difference {difference}; server: {hour.server['asked']} blocks asked")
    print(f"  with faults: {_cost(hour)}")
    failed = hour.unaccounted + abs(difference) + (not hour.server_balances)
    for check in CHECKS:
        found = list(check(hour))
        failed += len(found)
        print(f"  {check.__name__.replace('_', ' ')}: {len(found)}{''.join(f'{chr(10)}    {one}' for one in found[:5])}")
    return failed


def _by_reason(hour: Hour) -> str:
    reasons = Counter(gap.reason.partition(":")[0] for gap in hour.gaps)
    return ", ".join(f"{number} {reason}" for reason, number in reasons.most_common())


def _cost(hour: Hour) -> str:
    looks = len(hour.sweep_s)
    edge_us, server_us = hour.edge_cpu_s / looks * 1e6, hour.server_cpu_s / looks * 1e6
    return f"a look costs {edge_us:.0f} µs in the edge and {server_us:.0f} µs in the server"


if __name__ == "__main__":
    sys.exit(main())
