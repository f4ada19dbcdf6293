"""Shares of the gap that each cause closes, which add up: Shapley's value over the sets of causes.

share_i = Σ_S |S|! (n − |S| − 1)! / n! · (closed(S ∪ i) − closed(S))
"""

from collections.abc import Callable
from itertools import combinations
from math import factorial
from typing import TypeVar

Part = TypeVar("Part")
EXACT_MAX = 4


def shapley(causes: tuple[Part, ...], closed: Callable[[frozenset[Part]], float]) -> dict[Part, float]:
    """Share of each cause; above EXACT_MAX of them by leaving one out, scaled to the whole.

    closed: what a set of causes closes, 0 for none

    >>> shapley(("gravity", "play"), lambda s: 0.6 * ("gravity" in s) + 0.3 * ("play" in s))["gravity"].__round__(6)
    0.6
    """
    whole, count = frozenset(causes), len(causes)
    if count > EXACT_MAX:
        alone = {c: max(closed(whole) - closed(whole - {c}), 0.0) for c in causes}
        total = sum(alone.values()) or 1.0
        return {c: v / total * closed(whole) for c, v in alone.items()}
    values = {frozenset(s): closed(frozenset(s)) for n in range(count + 1) for s in combinations(causes, n)}
    shares = dict.fromkeys(causes, 0.0)
    for cause in causes:
        for others in (s for s in values if cause not in s):
            weight = factorial(len(others)) * factorial(count - len(others) - 1) / factorial(count)
            shares[cause] += weight * (values[others | {cause}] - values[others])
    return shares
