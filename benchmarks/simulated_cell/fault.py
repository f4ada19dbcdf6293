"""What breaks in one machine, and how big "1" is. These sizes were written down before anything was judged by them.

| kind | size 1 | comes | lasts |
|---|---|---|---|
| bearing | vibration × 2.5, one zone of ISO 20816, and 3 K; while the spindle turns | over 5 min | 40 to 60 min |
| chip_packing | load × 1.5 and vibration × 1.4 in the cut | at once | 4 to 12 min |
| spindle_heat | 12 K | over 15 min | 60 to 80 min |
| feed_mismatch | half the feed at the same load in the cut | at once | 6 to 15 min |
| intermittent | vibration × 2.5 and load × 1.25 in bursts of 30 to 60 s, each 2 to 4 min, in the cut | at once | 25 to 40 min |

Size s: factors to the power s (a feed of 1 / (1 + s)), temperatures times s. Judged at the sizes 0.5, 1 and 2; the headline is 1.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SIZES = (0.5, 1.0, 2.0)


class FaultKind(StrEnum):
    """What is broken."""

    BEARING = "bearing"
    CHIP_PACKING = "chip_packing"
    SPINDLE_HEAT = "spindle_heat"
    FEED_MISMATCH = "feed_mismatch"
    INTERMITTENT = "intermittent"


class Overlap(StrEnum):
    """What happens at the same time, on purpose.

    DISTURBANCE: one that lasts from two minutes before the fault to two after it
    PEER_CHANGE: it begins within a peer's tool change; OWN_CHANGE: within one of its own
    """

    NONE = "none"
    DISTURBANCE = "disturbance"
    PEER_CHANGE = "peer_change"
    OWN_CHANGE = "own_change"


LASTS_S = {
    FaultKind.BEARING: (2400, 3600),
    FaultKind.CHIP_PACKING: (240, 720),
    FaultKind.SPINDLE_HEAT: (3600, 4800),
    FaultKind.FEED_MISMATCH: (360, 900),
    FaultKind.INTERMITTENT: (1500, 2400),
}
RAMP_S = {FaultKind.BEARING: 300.0, FaultKind.SPINDLE_HEAT: 900.0}


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault of one machine, gone at `end_s`. bursts_s: when it shows, from the start; empty: all the time."""

    machine: int
    kind: FaultKind
    size: float
    start_s: float
    end_s: float
    overlap: Overlap
    bursts_s: tuple[tuple[float, float], ...] = ()


def draw_bursts(lasts_s: float, rng: np.random.Generator) -> tuple[tuple[float, float], ...]:
    """Bursts of 30 to 60 s, 2 to 4 min from one to the next."""
    at_s, found = 0.0, []
    while at_s < lasts_s - 60.0:
        found.append((at_s, at_s + float(rng.uniform(30, 60))))
        at_s += float(rng.uniform(120, 240))
    return tuple(found)


def course(fault: Fault, t_s: Floats) -> Floats:
    """How much of the fault there is at each time, 0 to 1."""
    ramp_s = RAMP_S.get(fault.kind, 0.0)
    inside = (t_s >= fault.start_s) & (t_s < fault.end_s)
    if ramp_s:
        share = np.clip(np.minimum(t_s - fault.start_s, fault.end_s - t_s) / ramp_s, 0.0, 1.0)
        return np.where(inside, share, 0.0)
    if fault.bursts_s:
        since = t_s - fault.start_s
        inside &= np.any([(since >= start) & (since < end) for start, end in fault.bursts_s], axis=0)
    return inside.astype(np.float64)
