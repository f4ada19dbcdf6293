"""Rule on the spindle's temperature: thermal runaway, dT/dt over a limit in K/min.

The slope is Theil's and Sen's: the median of the slopes of all pairs of the window's points, which neither a step of a sensor
that reports whole degrees nor single wrong points move (up to 29 % of them). A window of T seconds and a sensor of resolution q
leave about q/T of doubt: 1 K over 180 s is 0.33 K/min. The price is time: a slope that begins now is seen when it fills half
of the window, and before three quarters of a window is known nothing is said.

A value that jumps by more than `temperature_step_k_max` is no temperature of the same spindle (sensors that drop to 0 for a
second): it is left out, and believed as a new level once it has stayed for STRAY_S.

Theil, H.: A rank-invariant method of linear and polynomial regression analysis (1950); Sen, P. K., JASA 63 (1968) 1379-1389.
"""

from collections.abc import Sequence
from functools import cached_property
from itertools import combinations
from statistics import median
from typing import NamedTuple, Self

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from processors.config import ProcessorConfig
from processors.rules.alarm import Judgement, over, unknown, within
from processors.rules.spindle import Known

TEMPERATURE = "spindle_temp_c"
POINTS = 24
"""Points a window: 276 pairs."""
KNOWN_PART = 0.75
"""The part of a window that has to be known."""
STRAY_S = 10.0
LOWEST_C, HIGHEST_C = -60.0, 400.0
"""The temperatures beyond which nothing is a spindle's."""


class TemperatureLimits(ProcessorConfig):
    """The limits of runaway."""

    runaway_k_per_min: PositiveFloat = 5.0
    runaway_clear_k_per_min: PositiveFloat = 3.0
    runaway_window_s: float = Field(default=180.0, ge=30.0, le=3600.0)
    runaway_dwell_s: NonNegativeFloat = 10.0
    runaway_clear_s: NonNegativeFloat = 30.0
    temperature_step_k_max: PositiveFloat = 10.0

    @cached_property
    def too_short(self) -> Judgement:
        """The judgement while too little of a window is known."""
        return unknown(f"{TEMPERATURE} is known for less than {KNOWN_PART * self.runaway_window_s:g} s")

    @model_validator(mode="after")
    def _a_slope_can_be_seen(self) -> Self:
        if self.runaway_clear_k_per_min > self.runaway_k_per_min:
            raise ValueError(f"runaway_clear_k_per_min {self.runaway_clear_k_per_min:g} is above runaway_k_per_min")
        if self.tick_s > self.runaway_window_s / POINTS:
            raise ValueError(f"tick_s {self.tick_s:g} is more than runaway_window_s / {POINTS}")
        return self


class Trend(NamedTuple):
    """The temperature over the window.

    points: (s, °C), oldest first, one each window / POINTS; slope in K/min, None while too little of the window is known
    level_c: the last value that was believed; stray_s: since when values are too far from it
    """

    points: tuple[tuple[float, float], ...] = ()
    slope_k_per_min: float | None = None
    level_c: float | None = None
    stray_s: float | None = None


def slope_per_s(points: Sequence[tuple[float, float]]) -> float:
    """The median of the slopes of all pairs; points at different times.

    >>> slope_per_s([(0.0, 20.0), (10.0, 21.0), (20.0, 0.0), (30.0, 23.0), (40.0, 24.0)])
    0.1
    """
    return median((b_c - a_c) / (b_s - a_s) for (a_s, a_c), (b_s, b_c) in combinations(points, 2))


def followed(trend: Trend, limits: TemperatureLimits, temperature_c: float | None, at_s: float) -> Trend:
    """The temperature's trend as of this moment."""
    if temperature_c is None or not LOWEST_C <= temperature_c <= HIGHEST_C:
        return trend
    points, slope, level_c, stray_s = trend
    if level_c is not None and abs(temperature_c - level_c) > limits.temperature_step_k_max:
        if stray_s is None:
            return Trend(points, slope, level_c, at_s)
        if at_s - stray_s < STRAY_S:
            return trend
        points, slope, level_c, stray_s = Trend()  # another level: what came before it says nothing of a slope
    if points and at_s - points[-1][0] < limits.runaway_window_s / POINTS:
        if temperature_c == level_c and stray_s is None:
            return trend
        return tuple.__new__(Trend, (points, slope, temperature_c, None))
    points = (*(point for point in points if at_s - point[0] <= limits.runaway_window_s), (at_s, temperature_c))
    known = len(points) >= POINTS // 4 and points[-1][0] - points[0][0] >= KNOWN_PART * limits.runaway_window_s
    return Trend(points, 60.0 * slope_per_s(points) if known else None, temperature_c)


def thermal_runaway(limits: TemperatureLimits, trend: Trend, temperature: Known) -> Judgement:
    """Temperature rises faster than it may."""
    temperature_c, why_not = temperature
    if temperature_c is None:
        return unknown(why_not or "")
    if not LOWEST_C <= temperature_c <= HIGHEST_C:
        return unknown(f"{TEMPERATURE} is beyond any spindle")
    slope = trend.slope_k_per_min
    if slope is None:
        return limits.too_short
    judgement = within(slope, limits.runaway_k_per_min, limits.runaway_clear_k_per_min)
    text = f"{TEMPERATURE} rises by {slope:.1f} K/min, over {limits.runaway_k_per_min:g} K/min"
    return judgement or over(text, slope, limits.runaway_k_per_min, "K/min")
