"""The settings of the gap: the healthy period, floors, how soon to raise an alarm, and when a gap counts as open."""

from collections.abc import Mapping
from functools import cached_property
from typing import ClassVar, Self

from pydantic import AwareDatetime, Field, NonNegativeFloat, PositiveFloat, model_validator

from processors.config import ProcessorConfig
from processors.gap.signals import SIGNALS


class Config(ProcessorConfig):
    """The healthy period, the floors, and how soon to raise an alarm.

    healthy_from: with its time zone; without it, the first hours that are seen are taken to be healthy, and the basis says so
    open_floors, open_s: a standing gap whose mean is so many floors, for so long, stands open though it never grew
    rated_power_kw, idle_power_kw: of the drive, where the machine has no description
    """

    of_the_machine: ClassVar[Mapping[str, str]] = {"rated_power_kw": "[spindle]", "idle_power_kw": "[spindle]"}

    late_s_max: float = Field(default=60.0, ge=0.0, le=3600.0, description="processor thermal is a moment behind the machine")
    healthy_from: AwareDatetime | None = None
    healthy_hours: float = Field(default=336.0, gt=0.0, le=8766.0)
    floors: dict[str, PositiveFloat] = Field(default_factory=dict, description="by signal, in its unit; else learned")
    growth_floors: PositiveFloat = 0.5
    false_alarms_per_year: float = Field(default=0.1, gt=0.0, le=100.0)
    block_s: float = Field(default=3600.0, ge=60.0, le=86_400.0)
    window_hours: float = Field(default=2.0, gt=0.0, le=48.0)
    standing_hours: float = Field(default=8.0, gt=0.0, le=720.0)
    shown_s_min: float = Field(default=60.0, ge=1.0, le=3600.0, description="of a regime, before its standing figure is reported")
    open_floors: PositiveFloat = 2.0
    open_s: float = Field(default=600.0, ge=1.0, le=604_800.0)
    publish_s: float = Field(default=60.0, ge=1.0, le=3600.0)
    settle_s: NonNegativeFloat = 2.0
    rapid_feed_mm_min: PositiveFloat = 15_000.0
    rated_power_kw: PositiveFloat | None = None
    idle_power_kw: NonNegativeFloat | None = None

    @cached_property
    def blocks_of_window(self) -> int:
        """The blocks of a stretch that is long enough to diagnose."""
        return max(2, round(self.window_hours * 3600.0 / self.block_s))

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if unknown := sorted(set(self.floors) - set(SIGNALS)):
            raise ValueError(f"floors has {', '.join(unknown)}; there are {', '.join(SIGNALS)}")
        if self.tick_s > self.block_s / 4.0:
            raise ValueError(f"tick_s {self.tick_s:g} is more than a quarter of block_s {self.block_s:g}")
        return self
