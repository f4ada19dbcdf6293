"""The spindle as it is beside the twin: what it takes in air beyond the twin, and what its cuts take over the twin's, by tool.

    cut = load − idle of the twin − offset        offset ← load − idle of the twin, in air, at about this speed
    ratio = measured over expected cut, of late, of a tool

The constants of a twin are off by some percent, grease is cold in the morning and tools wear: what is usual is followed slowly,
so that what comes at once stands out. One sample counts for no more than a factor of 1.35.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

AIR_WEIGHT, OFFSET_PCT_MAX, SPEEDS_ALIKE = 0.3, 10.0, 0.1
RATIO_OVER_S, RATIO_KNOWN_S, STEP_MAX = 3600.0, 20.0, 0.3
RATIO_MAX = math.log(4.0)
TOOLS_MAX = 64


class Air(NamedTuple):
    """What the spindle takes in air beyond the twin, %, at a speed."""

    offset_pct: float
    rpm: float


class Ratio(NamedTuple):
    """Logarithm of measured over expected cut, and for how long cuts of the tool have been seen."""

    log: float
    seen_s: float

    @property
    def value(self) -> float | None:
        """Return the ratio; None while too little has been seen."""
        return math.exp(self.log) if self.seen_s >= RATIO_KNOWN_S else None


def offset_at(air: Air | None, rpm: float) -> float:
    """Return the offset that holds at a speed, 0 where it is not known."""
    return air.offset_pct if air is not None and abs(rpm - air.rpm) <= SPEEDS_ALIKE * air.rpm else 0.0


def air_after(air: Air | None, beyond_pct: float, rpm: float) -> Air:
    """Return the offset after one more sample in air.

    >>> air_after(air_after(None, 2.0, 4000.0), 3.0, 4010.0)
    Air(offset_pct=2.3, rpm=4010.0)
    """
    beyond_pct = min(max(beyond_pct, -OFFSET_PCT_MAX), OFFSET_PCT_MAX)
    if air is None or abs(rpm - air.rpm) > SPEEDS_ALIKE * air.rpm:
        return Air(beyond_pct, rpm)
    return Air(air.offset_pct + AIR_WEIGHT * (beyond_pct - air.offset_pct), rpm)


def ratios_after(ratios: Mapping[str, Ratio], tool: str, measured: float, expected: float, since_s: float) -> Mapping[str, Ratio]:
    """Return the ratios after one more sample of a cut; the tool that was seen least makes room for a new one.

    >>> seen = ratios_after({}, "3", 22.0, 20.0, 30.0)["3"]
    >>> round(seen.value, 3), seen.seen_s
    (1.1, 30.0)
    """
    found = max(-RATIO_MAX, min(RATIO_MAX, math.log(max(measured, 1e-6) / expected)))
    before = ratios.get(tool)
    if before is None:
        kept = ratios
        if len(ratios) >= TOOLS_MAX:
            least = min(ratios, key=lambda name: ratios[name].seen_s)
            kept = {name: own for name, own in ratios.items() if name != least}
        return {**kept, tool: Ratio(found, since_s)}
    if before.seen_s >= RATIO_KNOWN_S:
        found = max(before.log - STEP_MAX, min(before.log + STEP_MAX, found))
    seen_s = min(before.seen_s + since_s, RATIO_OVER_S)
    return {**ratios, tool: Ratio(before.log + since_s / seen_s * (found - before.log) if seen_s > 0.0 else found, seen_s)}
