"""Range-based precision and recall (Tatbul, Lee, Zdonik, Alam, Gottschlich 2018, "Precision and recall for time series").

    recall_T(R_i)    = α · [some P_j touches R_i] + (1 − α) · γ(x) · Σ_j ω(R_i, R_i ∩ P_j)
    precision_T(P_i) =                                        γ(x) · Σ_j ω(P_i, P_i ∩ R_j)

each averaged over its ranges. x: how many ranges overlap; γ(x) = 1/x, so that one event told in pieces counts less; ω: share of
the range that is overlapped, by position: all alike (flat), or its beginning more (front, for those who want to know early).
"""

from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple


class Bias(StrEnum):
    """Which positions of a range count more."""

    FLAT = "flat"
    FRONT = "front"


class Range(NamedTuple):
    """Ticks from start to before end."""

    start: int
    end: int


class PrecisionRecall(NamedTuple):
    """NaN where there are no ranges to average over."""

    precision: float
    recall: float


def range_based(
    real: Sequence[Range], predicted: Sequence[Range], existence: float = 0.5, bias: Bias = Bias.FLAT
) -> PrecisionRecall:
    """existence: the weight α of having touched an event at all.

    Half of an event is found, by an alarm that is right all the time:

    >>> range_based([Range(0, 10)], [Range(5, 10)], existence=0.0)
    PrecisionRecall(precision=1.0, recall=0.5)
    """
    recalls = []
    for one in real:
        parts = _parts(one, predicted)
        recalls.append(existence * bool(parts) + (1.0 - existence) * _reward(one, parts, bias))
    precisions = [_reward(one, _parts(one, real), Bias.FLAT) for one in predicted]
    return PrecisionRecall(_mean(precisions), _mean(recalls))


def ranges(flags: Sequence[bool]) -> list[Range]:
    """Stretches in which a flag is up.

    >>> ranges([False, True, True, False, True])
    [Range(start=1, end=3), Range(start=4, end=5)]
    """
    found, start = [], None
    for tick, flag in enumerate([*flags, False]):
        if flag and start is None:
            start = tick
        elif not flag and start is not None:
            found.append(Range(start, tick))
            start = None
    return found


def _parts(one: Range, others: Sequence[Range]) -> list[Range]:
    overlaps = (Range(max(one.start, other.start), min(one.end, other.end)) for other in others)
    return [part for part in overlaps if part.end > part.start]


def _reward(one: Range, parts: Sequence[Range], bias: Bias) -> float:
    return sum(_weight(one, part, bias) for part in parts) / max(1, len(parts))


def _weight(one: Range, part: Range, bias: Bias) -> float:
    length = one.end - one.start
    if bias is Bias.FLAT:
        return (part.end - part.start) / length
    first, last = part.start - one.start, part.end - one.start
    return (_sum_from(length - last + 1, length - first)) / _sum_from(1, length)


def _sum_from(first: int, last: int) -> float:
    """first + … + last: the front bias gives the first of n positions weight n, the last 1."""
    return (first + last) * (last - first + 1) / 2.0


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values) if values else float("nan")
