"""The common level of a part: what all its operations share (the material of the batch, the drift of the machine), and which of its
tools have been replaced.

    d_j = c + w_j + ε_j        d_j: level of tool j in this part, w_j: its wear, 0 for a sharp one
    c ~ N(c', v + p²)          as in the part before,   or   N(c̄, m²) in another batch

The explanation that costs least in −log probability is taken: the same batch or another one, and none, one or more of the tools
replaced since the part before; a tool that neither fits costs ODD, so one broken insert is no batch. This is the maximum a posteriori
among them, found greedily over the tools. An outlier of one tool is thus its own, and a step of all is the material's.
"""

from collections.abc import Sequence
from math import log, sqrt
from typing import NamedTuple

from twin.wear.terms import Terms

ODD = 8.0
"""Four standard deviations: what is further off is not explained."""
BATCH_COST = log(40.0)
REPLACED_COST, DUE_COST = log(400.0), log(15.0)
"""A tool is replaced in one part of so many; once its life is nearly over, far more often."""


class Material(NamedTuple):
    """The common level of the batch that runs, its variance, and the mean level of the batches so far."""

    level: float = 0.0
    var: float = 0.0
    mean: float = 0.0
    batches: int = 0


class Seen(NamedTuple):
    """A tool in one part: level; wear that is expected of it; sharp: the variance if it is a sharp one now, None = not known

    noise: variance of the level; var: of the wear; is_due: most of its life has gone
    """

    level: float
    noise: float
    wear: float
    var: float
    sharp: float | None = None
    is_due: bool = False


class Explained(NamedTuple):
    """The common level of the part and its variance; which tools (by place) were replaced; what each tool alone says of the level.

    single: (level, variance) of each tool
    """

    level: float
    var: float
    is_batch: bool
    replaced: frozenset[int]
    single: tuple[tuple[float, float], ...]

    def off(self, place: int) -> float:
        """Return by how many deviations a tool is off."""
        level, var = self.single[place]
        return (level - self.level) / sqrt(var)

    def without(self, place: int) -> tuple[float, float]:
        """Return the common level and its variance as they would be without a tool, so that it is not judged by itself."""
        level, var = self.single[place]
        weight = 1.0 / self.var - 1.0 / var
        if abs(self.off(place)) >= sqrt(2.0 * ODD) or weight <= 0.0:
            return self.level, self.var
        return (self.level / self.var - level / var) / weight, 1.0 / weight


def explained(tools: Sequence[Seen], material: Material, terms: Terms) -> Explained:
    """Return the explanation of a part that costs least.

    >>> material, terms = Material(0.0, 1e-6), Terms()
    >>> tools = [Seen(0.20, 1e-4, 0.2, 1e-4, 4e-4), Seen(0.1, 1e-4, 0.1, 1e-4, 4e-4), Seen(0.0, 1e-4, 0.15, 1e-4, 4e-4)]
    >>> sorted(explained(tools, material, terms).replaced)
    [2]
    """
    replaced: frozenset[int] = frozenset()
    best = _fitted(tools, replaced, material, terms)
    while True:
        others = [
            (_fitted(tools, replaced | {place}, material, terms), replaced | {place})
            for place, tool in enumerate(tools)
            if tool.sharp is not None and place not in replaced
        ]
        if not others:
            break
        (found, which) = min(others, key=lambda one: one[0][0])
        if found[0] >= best[0]:
            break
        best, replaced = found, which
    _, level, var, is_batch = best
    return Explained(level, var, is_batch, replaced, tuple(_residuals(tools, replaced)))


def _residuals(tools: Sequence[Seen], replaced: frozenset[int]) -> list[tuple[float, float]]:
    return [
        (one.level, one.noise + (one.sharp or 0.0)) if place in replaced else (one.level - one.wear, one.noise + one.var)
        for place, one in enumerate(tools)
    ]


def _fitted(
    tools: Sequence[Seen], replaced: frozenset[int], material: Material, terms: Terms
) -> tuple[float, float, float, bool]:
    """Return cost, common level, its variance, and whether another batch has begun."""
    seen = _residuals(tools, replaced)
    cost = sum(DUE_COST if tools[place].is_due else REPLACED_COST for place in replaced)
    same = _level(seen, material.level, material.var + terms.part**2)
    other = _level(seen, material.mean, terms.material**2)
    is_batch = other[0] + BATCH_COST < same[0]
    found = other if is_batch else same
    return cost + found[0] + (BATCH_COST if is_batch else 0.0), found[1], found[2], is_batch


def _level(seen: Sequence[tuple[float, float]], prior: float, var: float) -> tuple[float, float, float]:
    """Return the cost, mean and variance of the common level, what is off by more than ODD left out.

    The cost has bounded losses, so it may have several minima: one is sought from the prior and from each of what was seen.
    """
    best = (float("inf"), prior, var)
    for start in (prior, *(d for d, _ in seen)):
        mean, weight = start, 1.0 / var
        for _ in range(3):
            weight, total = 1.0 / var, prior / var
            for d, v in seen:
                if (d - mean) ** 2 < 2.0 * ODD * v:
                    weight += 1.0 / v
                    total += d / v
            mean = total / weight
        cost = 0.5 * (mean - prior) ** 2 / var + 0.5 * log(var * weight)
        cost += sum(min(0.5 * (d - mean) ** 2 / v, ODD) for d, v in seen)
        if cost < best[0]:
            best = (cost, mean, 1.0 / weight)
    return best


BATCH_WANDER = 1e-6
"""Variance by which the material of a batch wanders in a part: 1 % in a hundred parts."""
MEAN_BATCHES = 50


def followed(material: Material, found: Explained, terms: Terms) -> Material:
    """Return the material after a part; a single part differs from its batch by `terms.part`."""
    if found.is_batch:
        batches = min(material.batches + 1, MEAN_BATCHES)
        mean = material.mean + (material.level - material.mean) / (batches + 1)
        return Material(found.level, found.var, mean, batches)
    var = material.var + BATCH_WANDER
    white = terms.part**2
    # `found` already holds the prior: taken back out of it, what the part alone has told is left.
    own = 1.0 / max(1.0 / found.var - 1.0 / (material.var + white), 1e-9)
    own_level = found.level + own * (found.level - material.level) / (material.var + white) if own < 1e8 else found.level
    gain = var / (var + white + own)
    return material._replace(level=material.level + gain * (own_level - material.level), var=var * (1.0 - gain))
