#!/usr/bin/env python3
"""Each effect of the catalogue: is a machine that is made with it diagnosed as it, or as a class that holds it?

    .venv/bin/python benchmarks/gap/effects_found.py [--only EFFECT …] [--floors 2 10] [--json]

A small machine is simulated with each effect at twice and ten times its floor (`tests/twin/effects/made_with.py`) and diagnosed.
For each it prints the size, what came of it (named; in the class of what was named; unknown; missed, which is right where the
effect is within what the machine file does not know of its constants; wrong, with the name) and the seconds.

This costs 1 to 10 s of one core an effect and size, some five minutes for all. The machine is the twin itself: how well an effect
of another form is found, `cnctwin gap check` says.
"""

import argparse
import json
from collections import Counter
from time import perf_counter

from tests.twin.effects.made_with import diagnosed, outcome
from twin.effects.catalogue import catalogue, effect_named


def main() -> None:
    """Print a line for each effect and size, and how many of each outcome there were."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=[], metavar="EFFECT", help="effects of the catalogue; else all of them")
    parser.add_argument("--floors", type=float, nargs="+", default=[2.0, 10.0], help="sizes to make each effect at")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    rows: list[dict[str, object]] = []
    for effect in [effect_named(name) for name in arguments.only] or catalogue().values():
        for floors in arguments.floors:
            begun = perf_counter()
            found, size = diagnosed(effect, floors)
            seconds = perf_counter() - begun
            said = outcome(effect, found)
            rows.append({"effect": effect.name, "floors": floors, "size": size, "outcome": said, "seconds": seconds})
            if not arguments.json:
                print(f"{effect.name:28s} at {size:6.1f} floors  {said:40s} {seconds:6.1f} s", flush=True)
    if arguments.json:
        print(json.dumps(rows, indent=1))
        return
    counted = Counter(str(row["outcome"]).partition(":")[0] for row in rows)
    print(f"of {len(rows)}: {', '.join(f'{many} {what}' for what, many in counted.most_common())}")


if __name__ == "__main__":
    main()
