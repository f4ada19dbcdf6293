"""The explanation of a part: whether another batch has begun, and which of its tools have been replaced.

    c ~ N(c', …)   as in the part before,   or   N(c̄, m²)   in another batch

The explanation that costs least in −log probability is taken: the same batch or another one, and none, one or more of the tools
replaced since the part before; a tool that neither fits costs ODD, so one broken insert is no batch. This is the maximum a
posteriori among them, found greedily over the tools. An outlier of one tool is thus its own, and a step of all is the
material's.
"""

from collections.abc import Iterable, Sequence
from math import log, sqrt
from statistics import median
from typing import NamedTuple

from twin.wear.joint import MATERIAL, Joint, Observed, observed, off, only, renewed
from twin.wear.terms import Terms

ODD = 8.0
"""Four standard deviations: what is further off is not explained."""
BATCH_COST = log(40.0)
REPLACED_COST, DUE_COST = log(400.0), log(15.0)
"""A tool is replaced in one part of so many; once its life is nearly over, far more often."""
MEAN_BATCHES = 50
LOW = -2.0
"""Only tools that are lower than expected by two deviations may have been replaced."""


class Batches(NamedTuple):
    """The mean material of the batches so far, and their number."""

    mean: float = 0.0
    number: int = 0


class Seen(NamedTuple):
    """A tool in a part as it is if it goes on, and as it is if it was replaced; None = it can't be told. is_due: its life is
    nearly over
    """

    worn: Observed
    sharp: Observed | None = None
    is_due: bool = False


class Explained(NamedTuple):
    """The knowledge after the part; whether a batch began; the tools replaced, and by how many deviations each tool is off."""

    joint: Joint
    is_batch: bool
    replaced: frozenset[str]
    off: dict[str, float]


def explained(joint: Joint, tools: Sequence[Seen], batches: Batches, terms: Terms) -> Explained:
    """Return the explanation of a part that costs least."""
    here = only(joint, [one.worn.name for one in tools])
    replaced: frozenset[str] = frozenset()
    best = _cost(here, tools, replaced, batches, terms)
    while True:
        more = [
            (_cost(here, tools, replaced | {one.worn.name}, batches, terms), replaced | {one.worn.name})
            for one in tools
            if one.sharp is not None and one.worn.name not in replaced and best.off[one.worn.name] < LOW
        ]
        if not more:
            break
        found, which = min(more, key=lambda one: one[0].cost)
        if found.cost >= best.cost:
            break
        best, replaced = found, which
    joint = renewed(joint, MATERIAL, batches.mean, terms.material**2) if best.is_batch else joint
    _, joint, missed = _taken(joint, _levels(tools, replaced))
    return Explained(joint, best.is_batch, replaced, missed)


def followed(batches: Batches, before: float) -> Batches:
    """Return the batches with one more that has ended, of this material."""
    number = min(batches.number + 1, MEAN_BATCHES)
    return Batches(batches.mean + (before - batches.mean) / number, number)


def _levels(tools: Iterable[Seen], replaced: frozenset[str]) -> list[Observed]:
    return [one.sharp if one.sharp is not None and one.worn.name in replaced else one.worn for one in tools]


class _Costs(NamedTuple):
    """The cost of an explanation, whether another batch makes it cheaper, and by how many deviations each tool is off by it."""

    cost: float
    is_batch: bool
    off: dict[str, float]


def _cost(joint: Joint, tools: Sequence[Seen], replaced: frozenset[str], batches: Batches, terms: Terms) -> _Costs:
    cost = sum(DUE_COST if one.is_due else REPLACED_COST for one in tools if one.worn.name in replaced)
    levels = _levels(tools, replaced)
    same, _, off_same = _taken(joint, levels)
    if sum(0.5 * far * far for far in off_same.values()) < BATCH_COST:
        return _Costs(cost + same, False, off_same)  # another batch can't pay for itself
    other, _, off_other = _taken(renewed(joint, MATERIAL, batches.mean, terms.material**2), levels)
    if other + BATCH_COST < same:
        return _Costs(cost + other + BATCH_COST, True, off_other)
    return _Costs(cost + same, False, off_same)


def _taken(joint: Joint, levels: Sequence[Observed]) -> tuple[float, Joint, dict[str, float]]:
    """Return the cost of levels, the knowledge with them, and by how many deviations each is off.

    Those nearest to the middle are taken first, and what is odd beside them is left out.
    """
    misses = [off(joint, seen)[0] for seen in levels]
    middle = median(misses) if misses else 0.0
    order = sorted(range(len(levels)), key=lambda place: (abs(misses[place] - middle), abs(misses[place])))
    cost, missed = 0.0, {}
    for place in order:
        miss, var = off(joint, levels[place])
        missed[levels[place].name] = miss / sqrt(var)
        if 0.5 * miss * miss / var > ODD:
            cost += ODD + 0.5 * log(var)
            continue
        joint, own = observed(joint, levels[place])
        cost += own
    return cost, joint, missed
