"""Parts of three tools that wear evenly and are replaced, for tests: everything about them is known."""

from collections.abc import Iterator, Mapping
from math import exp
from random import Random
from typing import NamedTuple

from twin.wear.cut import Cut
from twin.wear.machine import Wear, cut_added
from twin.wear.terms import Terms

LENGTHS = {1: 60, 2: 85, 3: 110}
END = 0.3
"""The level at which a tool is replaced."""
TERMS = Terms()


class Made(NamedTuple):
    """The exceptions from even wear: batches by the part from which they run, rates by (tool, life)."""

    parts: int
    batches: Mapping[int, float] = {}
    rates: Mapping[tuple[int, int], float] = {}
    noise: float = 0.01
    seed: int = 1


def made(plan: Made) -> Iterator[tuple[tuple[Cut, ...], dict[int, tuple[int, float]]]]:
    """Yield the cuts of each part, and (life, wear over its end) of each tool in it."""
    chance, wear, life, material = Random(plan.seed), dict.fromkeys(LENGTHS, 0.4), dict.fromkeys(LENGTHS, 0), 0.0
    for part in range(plan.parts):
        material = plan.batches.get(part, material)
        cuts = []
        for tool in LENGTHS:
            ratio = exp(material + END * wear[tool] + plan.noise * chance.gauss(0.0, 1.0))
            cuts.append(Cut("O1", tool, f"O1|T{tool}|1", part, 300.0 * part + 10.0 * tool, ratio, 0.01, ratio))
        yield tuple(cuts), {tool: (life[tool], wear[tool]) for tool in LENGTHS}
        for tool, length in LENGTHS.items():
            wear[tool] += plan.rates.get((tool, life[tool]), 1.0) / length
            if wear[tool] >= 1.0:
                wear[tool], life[tool] = 0.0, life[tool] + 1


def judged(plan: Made, terms: Terms = TERMS) -> Wear:
    """Return the wear after all parts but the last, which has not ended yet."""
    wear = Wear()
    for cuts, _ in made(plan):
        for cut in cuts:
            wear, _ = cut_added(wear, cut, terms)
    return wear
