"""The load meter of a machine as a table: load over speed and power of the cut, sampled once from `twin.live.spindle`.

Between its points it is linear in both. A meter that nothing bends is a straight line in the power, so two points are exact.
A meter with a memory is taken as it shows a power that has stood for a while.
"""

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Self

from twin.live.spindle import LiveSpindle

SPEEDS, POWERS = 24, 32
ABOVE = 1.5
"""The table reaches so far beyond the fastest speed of the program: a speed override ends before."""


@dataclass(frozen=True)
class Meter:
    """speeds_rpm: (s,) and powers_kw: (p,), both rising; loads_pct: a row of (p,) for each speed."""

    speeds_rpm: tuple[float, ...]
    powers_kw: tuple[float, ...]
    loads_pct: tuple[tuple[float, ...], ...]

    @classmethod
    def of(cls, spindle: LiveSpindle, speeds_rpm: Iterable[float], power_max_kw: float) -> Self:
        """Return the table of a spindle; exact at the speeds of the program, `power_max_kw` the most that it shows well."""
        own = {round(abs(rpm), 6) for rpm in speeds_rpm}
        fastest = max(own, default=0.0) * ABOVE or 1000.0
        speeds = tuple(sorted(own | {fastest * k / SPEEDS for k in range(SPEEDS + 1)}))
        powers = (0.0, 1.0) if spindle.is_straight else tuple(power_max_kw * (k / POWERS) ** 2 for k in range(POWERS + 1))
        return cls(speeds, powers, tuple(tuple(spindle.load_pct(kw, rpm) for kw in powers) for rpm in speeds))

    @cached_property
    def _line(self) -> tuple[float, float] | None:
        """Load of air and load by kW, where these are the same at all speeds."""
        first = self.loads_pct[0]
        if len(self.powers_kw) > 2 or any(abs(a - b) > 1e-9 for row in self.loads_pct for a, b in zip(row, first, strict=True)):
            return None
        return first[0], (first[1] - first[0]) / (self.powers_kw[1] - self.powers_kw[0])

    def at(self, power_kw: float, rpm: float) -> tuple[float, float]:
        """Return the load of the cut alone and the load with what the spindle takes in air, %.

        >>> meter = Meter((0.0, 1000.0), (0.0, 1.0), ((2.0, 12.0), (4.0, 14.0)))
        >>> meter.at(0.5, 500.0)
        (5.0, 8.0)
        """
        if self._line is not None:
            cut_pct = power_kw * self._line[1]
            return cut_pct, cut_pct + self._line[0]
        speeds, powers = self.speeds_rpm, self.powers_kw
        s = bisect_right(speeds, rpm, 1, len(speeds) - 1)
        p = 1 if len(powers) == 2 else bisect_right(powers, power_kw, 1, len(powers) - 1)
        over = (rpm - speeds[s - 1]) / (speeds[s] - speeds[s - 1])
        part = (power_kw - powers[p - 1]) / (powers[p] - powers[p - 1])
        low, high = self.loads_pct[s - 1], self.loads_pct[s]
        idle = low[0] + over * (high[0] - low[0])
        below = low[p - 1] + over * (high[p - 1] - low[p - 1])
        above = low[p] + over * (high[p] - low[p])
        load = below + part * (above - below)
        return load - idle, load
