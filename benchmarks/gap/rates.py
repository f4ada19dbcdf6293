#!/usr/bin/env python3
"""The rate at which each effect is found: from a program that is designed for it, and from plain production motion.

    .venv/bin/python benchmarks/gap/rates.py [--only EFFECT …] [--rates 1000 100 50 20 10] [--floors 10]

An axis is simulated with each effect that an axis in air can show, at ten times its floor in the designed program. The same
machine then runs the production program: strokes and arcs at a few feeds, no reversals of micrometres, few rests. It is recorded
at 1 kHz, thinned to each rate and diagnosed. A row of the table is printed for each effect as soon as it is known:

    named    it is a cause by its name                     class    it is in the class of a cause
    wrong    something else is named, and it is not        unknown  there is a gap without a name
    –        it is called healthy, or cannot be seen at this rate; slower ones are not tried then

The machine is the twin's own simulator with other constants than its file states. An effect takes about a minute of one core.
"""

import argparse
from collections import Counter
from collections.abc import Callable

from tests.twin.effects.made_with import maker, outcome, sized
from tests.twin.gap.small_case import air_case, case_of, columns_of
from twin.case import Case
from twin.effects.catalogue import catalogue, effect_named
from twin.effects.effect import Effect
from twin.errors import TwinError
from twin.gap.diagnose import diagnose
from twin.machine import AddedEffect
from twin.sites import Site

RATES_HZ = (1000, 100, 50, 20, 10)
SAID = {"named": "named", "in the class": "class", "unknown": "unknown", "missed": "–"}


DESIGNED = {
    "learn": """
G4 P200\nG1 Z30 F1500\nG4 P400\nG1 Z29.99 F60\nG1 Z30\nG1 Z4 F3000\nG0 Z44\nG4 P400\nG1 Z12 F6000\nG1 Z2 F500\nG4 P400\nM30
""",
    "judge": """
G4 P300\nG1 Z24 F1200\nG4 P400\nG1 Z23.98 F90\nG1 Z24\nG1 Z2 F4200\nG0 Z40\nG4 P400\nG1 Z12 F2400\nG1 Z4 F600\nG4 P300\nM30
""",
}
PRODUCTION = {
    "learn": "G4 P200\nG0 Z30\nG1 Z12 F900\nG18 G2 X12 Z24 I12 K0 F1500\nG1 Z12 F900\nG0 Z30\nG1 Z8 F900\nG0 Z40\nG4 P200\nM30\n",
    "judge": "G4 P200\nG0 Z36\nG1 Z16 F1000\nG18 G2 X10 Z26 I10 K0 F1300\nG1 Z14 F1000\nG0 Z36\nG4 P200\nM30\n",
}


def designed(*effects: AddedEffect) -> Case:
    """Strokes of a second or two at six feeds both ways, rests after approaches from both sides, reversals of micrometres."""
    return air_case(*effects, **DESIGNED)


def production(*effects: AddedEffect) -> Case:
    """Strokes and arcs at a few feeds, as parts ask for them."""
    return air_case(*effects, **PRODUCTION)


def main() -> None:
    """Print a row for each effect, and how many were found at each rate."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--only", nargs="+", default=[], metavar="EFFECT", help="effects of the catalogue; else all of an axis")
    asked.add_argument(
        "--rates", type=int, nargs="+", default=list(RATES_HZ), metavar="HZ", help="divisors of 1000, fastest first"
    )
    asked.add_argument("--floors", type=float, default=10.0, help="size of each effect in the designed program")
    given = asked.parse_args()
    effects = [effect_named(name) for name in given.only] or [
        e for e in catalogue().values() if maker(e) is air_case and e.site is not Site.PROGRAM
    ]
    programs = (designed, production)
    print(f"| effect | {' | '.join(f'{make.__name__}, {hz} Hz' for make in programs for hz in given.rates)} |")
    print("|---" * (1 + 2 * len(given.rates)) + "|")
    found: Counter[int] = Counter()
    for effect in effects:
        one, _ = sized(effect, given.floors, designed)
        answers = [said for make in programs for said in by_rate(effect, one, make, given.rates)]
        found.update(place for place, said in enumerate(answers) if said in ("named", "class"))
        print(f"| `{effect.name}` | {' | '.join(answers)} |", flush=True)
    print(f"| found, of {len(effects)} | {' | '.join(str(found[place]) for place in range(2 * len(given.rates)))} |")


def by_rate(effect: Effect, one: AddedEffect, make: Callable[..., Case], rates_hz: list[int]) -> list[str]:
    """Return the answer at each rate, fastest first; below a rate at which nothing is named, nothing is tried."""
    columns = columns_of(case := make(one))
    said: list[str] = []
    for hz in rates_hz:
        if said and said[-1] == "–":
            said.append("–")
            continue
        every = round(1000 / hz)
        thin = case_of(case.machine, {name: {k: v[::every] for k, v in own.items()} for name, own in columns.items()})
        try:
            answer = outcome(effect, diagnose(thin).diagnosis)
        except TwinError:  # nothing in it can be compared
            answer = "missed"
        said.append(SAID.get(answer, answer))
    return said


if __name__ == "__main__":
    main()
