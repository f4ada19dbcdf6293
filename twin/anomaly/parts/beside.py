"""The remainder of residuals that peers do not share, signal by signal and scale by scale.

    left = sign(s) · max(0, |s| − 2 · c)     c: the ⌈n/5⌉-th largest of the peers' s in the direction of s, or 0

as `twin/anomaly/common_features.py` does it. Peers mill other parts: their signals are not comparable, their residuals are. What
shakes the floor is taken out of each tick instead, and so is what makes cuts harder out of an operation's (`shared.py`).
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from twin.anomaly.common_features import GAIN, ONE_IN
from twin.anomaly.parts.scales import COUNT

if TYPE_CHECKING:
    from twin.anomaly.parts.own import Own


def left_over(own: "Own", peers: Sequence["Own"], index: int, memory_ticks: int) -> float:
    """Return the part of a residual that the peers do not explain; index: signal by signal, each on all scales."""
    value, signal, oldest = own.smooth[index], index // COUNT, own.tick - memory_ticks
    theirs = [peer.smooth[index] for peer in peers if peer.told_at[signal] >= oldest]
    if not theirs:
        return value
    if value < 0.0:
        return -max(0.0, -value - GAIN * max(0.0, -_shared(theirs, is_above=False)))
    return max(0.0, value - GAIN * max(0.0, _shared(theirs, is_above=True)))


def _shared(theirs: list[float], *, is_above: bool) -> float:
    """Return the peers' residual that counts: the furthest, or of six and more that of the second fifth."""
    place = math.ceil(len(theirs) / ONE_IN) - 1
    if place == 0:
        return max(theirs) if is_above else min(theirs)
    return sorted(theirs, reverse=is_above)[place]
