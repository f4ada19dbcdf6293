"""The settings of tool wear: when parts left are given, what an alarm is, and how soon drift is told."""

from functools import cached_property
from math import log1p

from pydantic import Field, PositiveFloat

from processors.config import ProcessorConfig
from twin.wear.terms import Terms


class Config(ProcessorConfig):
    """wear_limit_pct: load over that of a sharp tool at which one is spent, until two of its lives have told it; None = not known

    material_pct, part_pct: by how much the load differs from batch to batch, and from part to part of a batch (standard
    deviations)
    """

    late_s_max: float = Field(default=60.0, ge=0.0, le=3600.0, description="joint_anomaly is a moment behind the machine")
    wear_limit_pct: float | None = Field(default=None, gt=0.0, le=1000.0)
    material_pct: float = Field(default=5.0, gt=0.0, le=100.0)
    part_pct: float = Field(default=0.5, gt=0.0, le=20.0)
    parts_min: int = Field(default=8, ge=6, le=1000, description="of a life, before parts left are given")
    fast_times: float = Field(default=2.0, gt=1.0, le=100.0, description="as fast as its lives before, the least for an alarm")
    block_h: float = Field(default=8.0, ge=0.1, le=168.0, description="the drift is judged once in so long")
    block_parts_min: int = Field(default=5, ge=1, le=10_000)
    healthy_blocks: int = Field(default=60, ge=40, le=10_000, description="that the machine is taken to be healthy at first")
    drift_pct: PositiveFloat = Field(default=5.0, le=100.0)
    false_alarms_per_year: float = Field(default=0.1, gt=0.0, le=100.0, description="of drift, for a machine")

    @cached_property
    def terms(self) -> Terms:
        """The settings of the model, as logarithms."""
        limit = None if self.wear_limit_pct is None else log1p(self.wear_limit_pct / 100.0)
        return Terms(limit, self.material_pct / 100.0, self.part_pct / 100.0, uses_min=self.parts_min, fast=self.fast_times)
