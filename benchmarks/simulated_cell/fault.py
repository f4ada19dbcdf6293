"""Faults of one machine, and how big "1" is. These sizes were written down before anything was judged by them.

| kind | size 1 | comes | lasts |
|---|---|---|---|
| bearing | vibration × 2.5, one zone of ISO 20816, and 3 K; while the spindle turns | over 5 min | 40 to 60 min |
| chip_packing | load × 1.5 and vibration × 1.4 in the cut | at once | 4 to 12 min |
| spindle_heat | 12 K | over 15 min | 60 to 80 min |
| feed_mismatch | half the feed at the same load in the cut | at once | 6 to 15 min |
| intermittent | vibration × 2.5 and load × 1.25 in bursts of 30 to 60 s, each 2 to 4 min, in the cut | at once | 25 to 40 min |
| dulling_tool | one tool wears 15 times as fast: as by 15 parts in 8 min | slowly | 50 to 90 min |
| broken_insert | one tooth of one tool is 0.1 mm short | at once | 20 to 40 min |
| broken_tool | one tool cuts nothing, from one second to the next; it has no other size | at once | 8 to 15 min |
| tool_too_long | one tool cuts 0.4 mm deeper: the one that cuts least deep, 0.3 to 3 mm | at once | 20 to 40 min |
| wrong_material | coefficient and edge force × 1.3, from the beginning of a part on | at once | 1 or 2 parts |
| coolant_off | nothing flows though the control says so: wet cuts × 1.2 in coefficient and edge force | at once | 20 to 40 min |
| worn_bearing | idle power × 1.3, vibration × 1.5 while it turns; judged apart | over days | 4 to 6 days |

The life of a tool is 40 parts. It doubles the force of the edge and raises the coefficient by 5 %; a dulling tool goes on to four
lives.
Size s: factors to the power s (a feed of 1 / (1 + s)); temperatures, lengths and the rate of wear times s; coolant that flows
1 − min(s, 1). Judged at the sizes 0.5, 1 and 2; the headline is 1. A worn bearing is judged by itself,
on the scale of weeks.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SIZES = (0.5, 1.0, 2.0)


class FaultKind(StrEnum):
    """The kinds of a fault."""

    BEARING = "bearing"
    CHIP_PACKING = "chip_packing"
    SPINDLE_HEAT = "spindle_heat"
    FEED_MISMATCH = "feed_mismatch"
    INTERMITTENT = "intermittent"
    DULLING_TOOL = "dulling_tool"
    BROKEN_INSERT = "broken_insert"
    BROKEN_TOOL = "broken_tool"
    TOOL_TOO_LONG = "tool_too_long"
    WRONG_MATERIAL = "wrong_material"
    COOLANT_OFF = "coolant_off"
    WORN_BEARING = "worn_bearing"


class Overlap(StrEnum):
    """A coincidence with something else, on purpose.

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
    FaultKind.DULLING_TOOL: (3000, 5400),
    FaultKind.BROKEN_INSERT: (1200, 2400),
    FaultKind.BROKEN_TOOL: (480, 900),
    FaultKind.TOOL_TOO_LONG: (1200, 2400),
    FaultKind.WRONG_MATERIAL: (900, 900),
    FaultKind.COOLANT_OFF: (1200, 2400),
    FaultKind.WORN_BEARING: (345_600, 518_400),
}
RAMP_S = {FaultKind.BEARING: 300.0, FaultKind.SPINDLE_HEAT: 900.0}
ONE_TOOL = frozenset({FaultKind.DULLING_TOOL, FaultKind.BROKEN_INSERT, FaultKind.BROKEN_TOOL, FaultKind.TOOL_TOO_LONG})
"""Kinds that belong to one tool: seen only while it is in the spindle."""
PLANTED = tuple(kind for kind in FaultKind if kind is not FaultKind.WORN_BEARING)
WEAR_OF_LIFE_EDGE, WEAR_OF_LIFE_COEFFICIENT = 1.0, 0.05
"""Shares by which wear of 1, which is 40 parts, raises the force of the edge and the coefficient."""
WEARS_FASTER, PART_S, LIFE_PARTS = 15.0, 480.0, 40
WEAR_MAX = 4.0
CHIPPED_MM, LONGER_MM = 0.1, 0.4


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault of one machine, gone at `end_s`. bursts_s: when it shows, from the start; empty: all the time.

    tool: whose fault it is, 0 = of no tool alone
    """

    machine: int
    kind: FaultKind
    size: float
    start_s: float
    end_s: float
    overlap: Overlap
    bursts_s: tuple[tuple[float, float], ...] = ()
    tool: int = 0


def draw_bursts(lasts_s: float, rng: np.random.Generator) -> tuple[tuple[float, float], ...]:
    """Bursts of 30 to 60 s, 2 to 4 min from one to the next."""
    at_s, found = 0.0, []
    while at_s < lasts_s - 60.0:
        found.append((at_s, at_s + float(rng.uniform(30, 60))))
        at_s += float(rng.uniform(120, 240))
    return tuple(found)


def course(fault: Fault, t_s: Floats) -> Floats:
    """Return the share of the fault at each time, 0 to 1; for a dulling tool, the wear that has come at size 1."""
    inside = (t_s >= fault.start_s) & (t_s < fault.end_s)
    since = t_s - fault.start_s
    if fault.kind is FaultKind.DULLING_TOOL:
        return np.where(inside, WEARS_FASTER / LIFE_PARTS * since / PART_S, 0.0)
    if fault.kind is FaultKind.WORN_BEARING:
        return np.where(inside, since / (fault.end_s - fault.start_s), 0.0)
    ramp_s = RAMP_S.get(fault.kind, 0.0)
    if ramp_s:
        share = np.clip(np.minimum(since, fault.end_s - t_s) / ramp_s, 0.0, 1.0)
        return np.where(inside, share, 0.0)
    if fault.bursts_s:
        inside &= np.any([(since >= start) & (since < end) for start, end in fault.bursts_s], axis=0)
    return inside.astype(np.float64)
