"""Limits that false alarms have raised: by operation, signal, scale and side.

    factor = min(FACTOR_MAX, MARGIN · left / threshold)         of each share of the alarm's signature that is large enough
    which is forgotten: 1 + (factor − 1) · 2^(−age / HALF_LIFE_S)

What is left of a signal beside the peers is divided by it, so each share of the same alarm is at most 1 / MARGIN thresholds. A
score that is the length of several is below the threshold then: of two by (Σ u²)^(1/2), of five by (Σ u⁴)^(1/4).
"""

from collections.abc import Iterable
from typing import NamedTuple

from twin.anomaly.parts.alarms.signature import Signature
from twin.anomaly.parts.scales import SCALES

FACTOR_MAX = 6.0
FACTOR_LEAST = 1.05
"""A raised limit below it is forgotten."""
MARGIN = 1.6
HALF_LIFE_S = 60 * 86_400.0
TOLERATED_MAX = 100
LASTING = SCALES[1:]
"""Scales whose limits rise together: an alarm that lasts for a cut reaches the longer ones too, after a person has judged it."""


class Tolerated(NamedTuple):
    """A limit that a false alarm has raised, in all operations in which it was seen; episode_s: when the alarm began."""

    episode_s: float
    operations: tuple[str, ...]
    signal: str
    scale: str
    side: int
    factor: float
    since_s: float
    by: str


def raised(
    episode_s: float, operations: tuple[str, ...], signature: Signature, threshold: float, by: str, now_s: float
) -> tuple[Tolerated, ...]:
    """Return the limits after an alarm that was called false."""
    factors: dict[tuple[str, int, str], float] = {}
    for share in signature.shares:
        factor = min(FACTOR_MAX, round(MARGIN * abs(share.left) / threshold, 3))
        for scale in LASTING if share.scale in LASTING else (share.scale,):
            key = (share.signal, share.side, scale)
            factors[key] = max(factors.get(key, 1.0), factor)
    return tuple(
        Tolerated(episode_s, operations, signal, scale, side, factor, now_s, by)
        for (signal, side, scale), factor in factors.items()
        if factor >= FACTOR_LEAST
    )


def bounded(tolerated: Iterable[Tolerated], now_s: float) -> tuple[Tolerated, ...]:
    """Return the raised limits, those of later alarms last: as many as are remembered, the largest of them."""
    alive = [one for one in tolerated if factor_at(one, now_s) > 1.0]
    largest = sorted(alive, key=lambda one: (-factor_at(one, now_s), one))[:TOLERATED_MAX]
    return tuple(sorted(largest))


def limit_factor(tolerated: tuple[Tolerated, ...], operation: str, signal: str, scale: str, side: int, at_s: float) -> float:
    """Return by how much the limit of a signal, scale and side is raised in an operation.

    >>> one = Tolerated(0.0, ("O1|T5|1",), "spindle_load_pct", "cut", 1, 3.0, 0.0, "ada")
    >>> [limit_factor((one,), "O1|T5|1", "spindle_load_pct", "cut", 1, days * 86400.0) for days in (0, 60, 120)]
    [3.0, 2.0, 1.5]
    """
    return limits_of(tolerated, operation, at_s).get((signal, scale, side), 1.0) if tolerated else 1.0


def limits_of(tolerated: tuple[Tolerated, ...], operation: str, at_s: float) -> dict[tuple[str, str, int], float]:
    """Return the raised limits of an operation, by signal, scale and side."""
    found: dict[tuple[str, str, int], float] = {}
    for one in tolerated:
        if operation in one.operations:
            key = (one.signal, one.scale, one.side)
            found[key] = max(found.get(key, 1.0), factor_at(one, at_s))
    return found


def factor_at(one: Tolerated, at_s: float) -> float:
    """Return a raised limit as of `at_s`; 1 once it is forgotten."""
    factor = 1.0 + (one.factor - 1.0) * 2.0 ** (-max(at_s - one.since_s, 0.0) / HALF_LIFE_S)
    return factor if factor >= FACTOR_LEAST else 1.0
