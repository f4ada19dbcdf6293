"""The meaning of a threshold: so many alerts a machine-week, on scores that came about with these settings."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from twin.anomaly.alarm import AlarmRule
from twin.anomaly.common_mode import Method

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Record(BaseModel):
    """A part of a manifest: nothing but the keys that exist, nothing changed after it was read."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Calibration(Record):
    """The threshold of the adjusted score, and what it was fitted on.

    tick_s … look_back_s: the settings under which scores came about; the threshold means nothing under others
    alerts_per_week: asked for; estimate, low, high: found at the threshold, a machine-week, with an interval of 90 %
    hours: of scores that it was fitted on, gated ones left out; is_extrapolated: the threshold lies beyond what was seen;
    clusters: alarms at a lower threshold that it rests on
    raw_center, raw_spread: median and robust standard deviation of the raw score while not gated, from which z comes
    hourly_means: of the raw score while not gated, by hour, oldest first; what drift is judged against
    """

    tick_s: Positive
    dwell_ticks: int = Field(ge=1)
    clear_fraction: Positive
    calm_s: NotNegative = 0.0
    common_mode: Method
    common_mode_factor: Positive
    exclude_gated_peers: bool
    tail_s: NotNegative
    look_back_s: NotNegative
    threshold: Positive
    alerts_per_week: Positive
    estimate: NotNegative
    low: NotNegative
    high: NotNegative
    hours: NotNegative
    is_extrapolated: bool
    clusters: int = Field(default=0, ge=0)
    raw_center: Finite
    raw_spread: Positive
    hourly_means: tuple[Finite, ...] = Field(default=(), max_length=10_000)

    @property
    def rule(self) -> AlarmRule:
        """The rule of the alarm."""
        return AlarmRule(self.threshold, self.dwell_ticks, self.clear_fraction, round(self.calm_s / self.tick_s))

    @property
    def in_words(self) -> str:
        """Describe in one line what the threshold rests on."""
        found = f"{self.estimate:.2g} alerts a machine-week ({self.low:.2g} to {self.high:.2g}) in {self.hours:.0f} h"
        return f"{self.threshold:.4g}, {found}{', beyond what was seen' if self.is_extrapolated else ''}"
