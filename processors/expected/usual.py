"""The spindle as it is beside the twin: what it takes in air beyond the twin, and what its cuts take over the twin's, by tool.

    beyond = load in air − idle of the twin ≈ a + b (n / n₁)²        by least squares that forgets, over samples in air
    cut = load − idle of the twin − beyond        ratio = measured over expected cut, of late, of a tool

The constants of a twin are off by some percent, bearings and grease take more at speed and when cold, tools wear: what is usual
is followed slowly, so that what comes at once stands out. One sample of a cut counts for no more than a factor of 1.35.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

SPEED_RPM = 10_000.0
FORGETS, SURE, STRAY_PCT, BEYOND_PCT_MAX = 0.995, 10.0, 6.0, 25.0
"""Share that is kept at each sample; the weight after which one that is STRAY_PCT off is none of air."""
PRIOR = 0.05
RATIO_OVER_S, RATIO_KNOWN_S, STEP_MAX = 3600.0, 20.0, 0.3
RATIO_MAX = math.log(4.0)
TOOLS_MAX = 64


class Air(NamedTuple):
    """Sums over samples in air, x = (n / n₁)², y = load beyond the twin, %."""

    weight: float = 0.0
    x: float = 0.0
    xx: float = 0.0
    y: float = 0.0
    xy: float = 0.0

    def beyond_pct(self, rpm: float) -> float:
        """Return what the spindle takes in air beyond the twin at a speed, 0 where nothing has been seen.

        >>> air = Air()
        >>> for rpm, pct in [(2000.0, 1.4), (10000.0, 11.0)] * 50:
        ...     air = air_after(air, pct, rpm)
        >>> round(air.beyond_pct(6000.0), 1)
        4.6
        """
        if self.weight <= 0.0:
            return 0.0
        x, mean_x, mean_y = (rpm / SPEED_RPM) ** 2, self.x / self.weight, self.y / self.weight
        spread = self.xx - self.weight * mean_x**2 + PRIOR * mean_x**2
        slope = (self.xy - self.weight * mean_x * mean_y + PRIOR * mean_x * mean_y) / spread if spread > 0.0 else 0.0
        return max(-BEYOND_PCT_MAX, min(BEYOND_PCT_MAX, mean_y + slope * (x - mean_x)))


def air_after(air: Air, beyond_pct: float, rpm: float) -> Air:
    """Return the sums after one more sample in air; one that is far from what is known is left out."""
    if abs(beyond_pct) > BEYOND_PCT_MAX or (air.weight > SURE and abs(beyond_pct - air.beyond_pct(rpm)) > STRAY_PCT):
        return air
    x = (rpm / SPEED_RPM) ** 2
    weight, xs, xx, y, xy = air
    k = FORGETS
    return Air(k * weight + 1.0, k * xs + x, k * xx + x * x, k * y + beyond_pct, k * xy + x * beyond_pct)


class Ratio(NamedTuple):
    """Logarithm of measured over expected cut, and for how long cuts of the tool have been seen."""

    log: float
    seen_s: float

    @property
    def value(self) -> float | None:
        """Return the ratio; None while too little has been seen."""
        return math.exp(self.log) if self.seen_s >= RATIO_KNOWN_S else None


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
