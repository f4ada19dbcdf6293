"""Configuration of `joint_anomaly`: which models score, what is common mode, when the gate is shut, when a score is an alarm."""

import math
from functools import cached_property
from typing import ClassVar, Self

from pydantic import Field, PositiveFloat, model_validator

from processors.config import CellConfig
from processors.joint_anomaly.gate import GateRule
from twin.anomaly.common_mode import CommonModeRule, Method
from twin.vocabulary import twin_signals

FITTED_WITH = (
    *("tick_s", "dwell_ticks", "clear_fraction", "calm_s", "common_mode", "common_mode_factor", "exclude_gated_peers"),
    *("tail_s", "look_back_s"),
)
"""The settings that a threshold holds for."""
WAITING_MAX = 5000  # scores of one machine
TICK_ROUNDING = 1e-3
NUMBERS = frozenset(
    {
        *("spindle_rpm", "spindle_rpm_cmd", "spindle_load_pct", "spindle_power_kw", "spindle_current_a", "feed_mm_min"),
        *("feed_override_pct", "rapid_override_pct", "spindle_override_pct", "spindle_temp_c", "ambient_temp_c"),
        *("vibration_rms_g", "vibration_velocity_mm_s"),
        *(f"axis_{axis}_load_pct" for axis in "xyzabc"),
        *(twin_signals.VIBRATION_RMS_G, twin_signals.VIBRATION_VELOCITY_MM_S),
        *(twin_signals.VIBRATION_CREST_FACTOR, twin_signals.VIBRATION_KURTOSIS),
        *(twin_signals.SPINDLE_TEMP_RESIDUAL_K, twin_signals.CUTTING_FORCE_N),
    }
)
"""The features that a model may have."""


class Config(CellConfig):
    """The models, the rule of common mode, the gate and the alarm.

    models: folder with one model for each machine, by name; "" = none: every score is null then, and says so
    expectations: folder with what the twin expects of each machine's programs (`cnctwin expect`); "" = none: parts are compared
        with parts alone
    threshold: in units of the adjusted score; absent = that of the model
    peer_wait_s: machines whose ticks are no further apart wait for each other (`processors/joint_anomaly/frames.py`); one that
        says nothing is at least 2 s and a tick behind, since its messages might still be on their way
    """

    of_one_machine: ClassVar[frozenset[str] | None] = frozenset({"threshold"})

    models: str = ""
    expectations: str = ""
    common_mode: Method = Method.PARTS
    common_mode_factor: PositiveFloat = 0.5
    exclude_gated_peers: bool = False
    tail_s: float = Field(default=8.0, ge=0.0, le=600.0)
    look_back_s: float = Field(default=0.0, ge=0.0, le=600.0)
    gate_s_max: float = Field(default=180.0, gt=0.0, le=3600.0)
    threshold: PositiveFloat | None = None
    dwell_ticks: int = Field(default=3, ge=1, le=3600)
    clear_fraction: float = Field(default=0.8, gt=0.0, le=1.0)
    calm_s: float = Field(default=600.0, ge=0.0, le=86_400.0)
    peer_wait_s: float = Field(default=5.0, ge=0.0, le=600.0)

    @cached_property
    def gate_rule(self) -> GateRule:
        """The rule by which scores are gated."""
        tail_ticks = math.ceil(self.tail_s / self.tick_s - TICK_ROUNDING)
        return GateRule(tail_ticks * self.tick_s, self.look_back_ticks * self.tick_s, self.gate_s_max)

    @cached_property
    def common_mode_rule(self) -> CommonModeRule:
        """The rule of common mode."""
        return CommonModeRule(self.common_mode, self.common_mode_factor, self.exclude_gated_peers)

    @cached_property
    def tick_ms(self) -> int:
        """The tick in whole ms, as the lanes count it (`processors/running/lane.py`)."""
        return max(1, round(self.tick_s * 1000.0))

    @cached_property
    def wait_ticks(self) -> int:
        """The ticks for which peers are waited for."""
        return round(self.peer_wait_s / self.tick_s)

    @cached_property
    def look_back_ticks(self) -> int:
        """The ticks that pass before a frame is judged."""
        return math.ceil(self.look_back_s / self.tick_s - TICK_ROUNDING)

    @model_validator(mode="after")
    def _waiting_is_bounded(self) -> Self:
        if (self.look_back_s + self.peer_wait_s) / self.tick_s > WAITING_MAX:
            raise ValueError(f"look_back_s and peer_wait_s hold more than {WAITING_MAX} ticks; make tick_s longer")
        return self
