"""The remainder of residuals that peers do not share, signal by signal and scale by scale.

    left = sign(s) · max(0, |s| − 2 · c)     c: the ⌈n/5⌉-th largest of the peers' s in the direction of s, or 0

as `twin/anomaly/common_features.py` does it. Peers mill other parts: their signals are not comparable, their residuals are.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from twin.anomaly.common_features import GAIN, MEMORY_S, ONE_IN
from twin.anomaly.parts.scales import COUNT

if TYPE_CHECKING:
    from twin.anomaly.parts.own import Own


def left_over(own: "Own", peers: Sequence["Own"], index: int, tick_s: float) -> float:
    """Return the part of a residual that the peers do not explain; index: signal by signal, each on all scales."""
    value = own.smooth[index]
    signal, oldest = index // COUNT, own.tick - round(MEMORY_S / tick_s)
    if value > 0.0:
        theirs = [peer.smooth[index] for peer in peers if peer.told_at[signal] >= oldest]
        if not theirs:
            return value
        theirs.sort(reverse=True)
        return max(0.0, value - GAIN * max(0.0, theirs[math.ceil(len(theirs) / ONE_IN) - 1]))
    theirs = [peer.smooth[index] for peer in peers if peer.told_at[signal] >= oldest]
    if not theirs:
        return value
    theirs.sort()
    return min(0.0, value - GAIN * min(0.0, theirs[math.ceil(len(theirs) / ONE_IN) - 1]))
