"""Common mode across the machines of a cell: what all of them feel at once is no fault of one.

Coolant, air, mains, the sun on the hall or a fork-lift truck raise the scores of several machines together. Two ways to tell:

* `source`, as it was published:   common_i = raw_i > 0 and any(raw_j ≥ factor · raw_i for j ≠ i)
                                   adjusted_i = 0 where common_i or gated_i, else raw_i
  It needs a score whose 0 is normal and whose larger values are worse. Literally taken, a peer that changes its tool hides the
  fault of its neighbours; `exclude_gated_peers` leaves such peers out.
* `residual`:                      adjusted_i = z_i − max(0, centre of the z_j), z = (raw − its centre) / its spread
  with the median of the peers as centre, the largest of them where there are fewer than three. Peers in a tool change never
  count. Peers that are quieter than usual prove nothing: a centre below 0 is none. A fault that comes during a disturbance keeps
  its size, where the ratio rule drops it.

For one frame there is a form without numpy, for the stream; for a recording, arrays (T, N). Both give the same bits.
"""

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MEDIAN_PEERS_MIN = 3
"""With fewer peers the largest of them is their centre."""


class Method(StrEnum):
    """The method of judging a score beside those of the peers."""

    SOURCE = "source"
    RESIDUAL = "residual"
    FEATURES = "features"  # not of scores: twin/anomaly/common_features.py
    PARTS = "parts"  # not of scores: twin/anomaly/parts/


@dataclass(frozen=True, slots=True)
class CommonModeRule:
    """factor: share of the own score from which on a peer's (residual: the peers' centre) makes it common mode; the published
        rule gives no figure
    exclude_gated_peers: leave peers out that change their tool; the published rule does not. The residual always does.

    Raises ValueError where the factor is not above 0.
    """

    method: Method = Method.SOURCE
    factor: float = 0.5
    exclude_gated_peers: bool = False

    def __post_init__(self) -> None:
        if not self.factor > 0.0:
            raise ValueError(f"factor is {self.factor!r}; it has to be above 0, or every score is common mode")

    @property
    def leaves_gated_peers_out(self) -> bool:
        """Return True where peers that change their tool are ignored."""
        return self.exclude_gated_peers or self.method is Method.RESIDUAL


class Adjusted(NamedTuple):
    """The remainder of a score beside the peers.

    score: None where the own score is not known; in units of the score given in
    is_common: the peers explain the score (the residual subtracts them in any case)
    peer: place of the largest peer that counted, among those given; None where none did
    peers: how many counted
    """

    score: float | None
    is_common: bool
    peer: int | None
    peers: int


def standardised(raw: float, center: float, spread: float) -> float:
    """z of a raw score: how many spreads above its centre.

    >>> standardised(0.02, -0.1, 0.04)
    3.0
    """
    return (raw - center) / spread


def _left(rule: CommonModeRule, own: float | None, is_gated: bool, centre: float, peer: int | None, peers: int) -> Adjusted:
    """Return the remainder of a score; centre: of the peers' for the residual, the largest of them for `source`."""
    if own is None:
        return Adjusted(None, False, peer, peers)
    is_common = own > 0 and peers > 0 and centre >= rule.factor * own
    if is_gated or (is_common and rule.method is Method.SOURCE):
        return Adjusted(0.0, is_common, peer, peers)
    return Adjusted(own if rule.method is Method.SOURCE else own - max(0.0, centre), is_common, peer, peers)


def adjust_frame(rule: CommonModeRule, scores: Sequence[float | None], are_gated: Sequence[bool]) -> list[Adjusted]:
    """Judge all machines of one frame beside each other, the same as one by one; `peer` is the place in the frame.

    The largest peer of a machine is the largest of all, or the second where it is that itself; the middle of its peers is that
    of all in order, without itself.

    >>> [one.score for one in adjust_frame(CommonModeRule(), [0.3, 0.1, -0.1], [False] * 3)]
    [0.3, 0.0, -0.1]
    """
    leaves_out, takes_median = rule.leaves_gated_peers_out, rule.method is Method.RESIDUAL
    count, ordered = 0, []
    first = second = -math.inf
    first_place = second_place = None
    for place, score in enumerate(scores):
        if score is None or (leaves_out and are_gated[place]):
            continue
        count += 1
        if takes_median:
            ordered.append(score)
        if first_place is None or score > first:
            first, first_place, second, second_place = score, place, first, first_place
        elif second_place is None or score > second:
            second, second_place = score, place
    ordered.sort()
    judged = []
    for place, own in enumerate(scores):
        counts = own is not None and not (leaves_out and are_gated[place])
        peers = count - counts
        centre, peer = (second, second_place) if place == first_place else (first, first_place)
        if takes_median and peers >= MEDIAN_PEERS_MIN:
            at = bisect_left(ordered, own) if counts and own is not None else count
            low, high = (peers - 1) // 2, peers // 2
            centre = 0.5 * (ordered[low + (low >= at)] + ordered[high + (high >= at)])
        judged.append(_left(rule, own, are_gated[place], centre, peer, peers))
    return judged


def adjust_frames(
    rule: CommonModeRule, scores: "NDArray[np.float64]", are_gated: "NDArray[np.bool_]"
) -> tuple["NDArray[np.float64]", "NDArray[np.bool_]"]:
    """Adjusted scores and common mode, (T, N) each, of scores (T, N): raw ones for `source`, z for `residual`; NaN = not known.

    >>> import numpy as np
    >>> adjust_frames(CommonModeRule(), np.array([[0.3, 0.1, -0.1]]), np.zeros((1, 3), bool))[0].tolist()
    [[0.3, 0.0, -0.1]]
    """
    import numpy as np  # noqa: PLC0415  the stream needs none

    adjusted, common = np.empty(scores.shape), np.empty(scores.shape, dtype=np.bool_)
    counted = np.where(are_gated, np.nan, scores) if rule.leaves_gated_peers_out else scores
    for place in range(scores.shape[1]):
        own, peers = scores[:, place], np.delete(counted, place, axis=1)
        known = np.isfinite(peers).sum(axis=1)
        largest = np.where(np.isnan(peers), -np.inf, peers).max(axis=1, initial=-np.inf)
        if rule.method is Method.SOURCE:
            common[:, place] = (own > 0.0) & (largest >= rule.factor * own)
            left = np.where(common[:, place], 0.0, own)
        else:
            centre = np.maximum(0.0, _centre(peers, known, largest))
            common[:, place] = (own > 0.0) & (known > 0) & (centre >= rule.factor * own)
            left = own - centre
        adjusted[:, place] = np.where(are_gated[:, place] & ~np.isnan(own), 0.0, left)
    return adjusted, common


def _centre(peers: "NDArray[np.float64]", known: "NDArray[np.intp]", largest: "NDArray[np.float64]") -> "NDArray[np.float64]":
    import numpy as np  # noqa: PLC0415

    if peers.shape[1] < MEDIAN_PEERS_MIN:
        return largest
    ordered, row = np.sort(peers, axis=1), np.arange(len(peers))
    last = np.maximum(known - 1, 0)
    median = 0.5 * (ordered[row, last // 2] + ordered[row, np.minimum(known // 2, last)])
    return np.asarray(np.where(known < MEDIAN_PEERS_MIN, largest, median), dtype=np.float64)
