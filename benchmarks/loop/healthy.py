#!/usr/bin/env python3
"""Healthy machines for a quarter: would the loop have begun a diagnosis that nobody needs?

    .venv/bin/python -m benchmarks.loop.healthy [--machines 3] [--weeks 13] [--first-seed 1000] [--floors]

Thirteen weeks on a broker take hours, so the processors thermal and gap are folded in process here, over the same production
days as in benchmarks/gap/standing.py. What the loop goes by is printed for each machine: each time that a growth came on, and
that a gap stood open, in the two weeks that are stated to be healthy and after them. Nothing can be promoted where neither came.

--floors    with the floors that the plant of benchmarks/loop/end_to_end.py states, else with the defaults: learned
"""

import argparse
from datetime import UTC, datetime

from benchmarks.gap.standing import DAY_S, HEALTHY_DAYS, MONDAY_S, Folded, growths, told, watched
from cnctwin.standins.production.day import Production, production_days
from cnctwin.standins.simulated_machine.as_built import machine_as_built
from twin.vocabulary import twin_signals

FLOORS = {"spindle_temp_c": 0.3, "spindle_load_pct": 0.5, "tool_change_s": 0.15}


def opened(folded: Folded) -> list[tuple[float, str]]:
    """Return when a gap came to stand open, and which."""
    found, was_open = [], False
    for one in folded.said:
        if one.name == twin_signals.GAP_OPEN:
            is_open = one.value not in (None, "none")
            if is_open and not was_open:
                found.append((one.at_s, str(one.value)))
            was_open = is_open
    return found


def quarter(seed: int, weeks: float, floors: dict[str, float]) -> Folded:
    """Return the processors after the healthy weeks of a machine."""
    begun = watched(told())
    folded = Folded(begun.description, begun.table | {"floors": floors}) if floors else begun
    until_s = MONDAY_S + (HEALTHY_DAYS + 7.0 * weeks) * DAY_S
    for day in production_days([(until_s, Production(machine_as_built(), seed))], MONDAY_S):
        folded.feed(day)
    return folded


def main() -> None:
    """Print what came on, for each machine."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machines", type=int, default=3)
    parser.add_argument("--weeks", type=float, default=13.0)
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--floors", action="store_true")
    given = parser.parse_args()
    healthy_until_s = MONDAY_S + HEALTHY_DAYS * DAY_S
    for seed in range(given.first_seed, given.first_seed + given.machines):
        folded = quarter(seed, given.weeks, FLOORS if given.floors else {})
        opens = opened(folded)
        later = [one for one in opens if one[0] >= healthy_until_s]
        counts = f"open {len(opens) - len(later)} times in the healthy weeks, then {len(later)}"
        print(f"machine {seed}: {len(growths(folded))} growths; {counts}", flush=True)
        for at_s, text in (*growths(folded), *opens[:3], *later[:3]):
            print(f"    {datetime.fromtimestamp(at_s, UTC):%Y-%m-%d %H:%M} {text[:140]}", flush=True)


if __name__ == "__main__":
    main()
