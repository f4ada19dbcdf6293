"""What `joint_anomaly` is told: which models score, what is common mode, when the gate is shut, when a score is an alarm."""

import math
from collections.abc import Mapping
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

from pydantic import Field, PositiveFloat, model_validator

from processors.config import CellConfig
from processors.joint_anomaly.gate import GateRule
from processors.joint_anomaly.member import Seat
from twin.anomaly.common_mode import CommonModeRule, Method
from twin.errors import TwinError
from twin.vocabulary import twin_signals

if TYPE_CHECKING:
    from twin.anomaly.model import AnomalyModel, Calibration

FITTED_WITH = (
    *("tick_s", "dwell_ticks", "clear_fraction", "common_mode", "common_mode_factor", "exclude_gated_peers", "tail_s"),
    "look_back_s",
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
"""What a model may have as features."""


class Config(CellConfig):
    """Which models score, what is common mode, when the gate is shut, when a score is an alarm.

    models: folder with one model for each machine, by name; "" = none: every score is null then, and says so
    threshold: in units of the adjusted score; absent = that of the model
    peer_wait_s: machines whose ticks are no further apart wait for each other (`processors/joint_anomaly/frames.py`); one that
    says
        nothing is at least 2 s and a tick behind, since its messages might still be on their way
    """

    of_one_machine: ClassVar[frozenset[str] | None] = frozenset({"threshold"})

    models: str = ""
    common_mode: Method = Method.SOURCE
    common_mode_factor: PositiveFloat = 0.5
    exclude_gated_peers: bool = False
    tail_s: float = Field(default=8.0, ge=0.0, le=600.0)
    look_back_s: float = Field(default=0.0, ge=0.0, le=600.0)
    gate_s_max: float = Field(default=180.0, gt=0.0, le=3600.0)
    threshold: PositiveFloat | None = None
    dwell_ticks: int = Field(default=3, ge=1, le=3600)
    clear_fraction: float = Field(default=0.8, gt=0.0, le=1.0)
    peer_wait_s: float = Field(default=5.0, ge=0.0, le=600.0)

    @cached_property
    def loaded(self) -> "Mapping[str, AnomalyModel]":
        """The models by machine."""
        return _models_in(Path(self.models)) if self.models else {}

    @cached_property
    def gate_rule(self) -> GateRule:
        """When scores are gated."""
        tail_ticks = math.ceil(self.tail_s / self.tick_s - TICK_ROUNDING)
        return GateRule(tail_ticks * self.tick_s, self.look_back_ticks * self.tick_s, self.gate_s_max)

    @cached_property
    def common_mode_rule(self) -> CommonModeRule:
        """What is common mode."""
        return CommonModeRule(self.common_mode, self.common_mode_factor, self.exclude_gated_peers)

    @cached_property
    def seats(self) -> dict[str, Seat]:
        """By machine; filled as they are needed."""
        return {}

    @cached_property
    def tick_ms(self) -> int:
        """As the lanes count (`processors/running/lane.py`)."""
        return max(1, round(self.tick_s * 1000.0))

    @cached_property
    def wait_ticks(self) -> int:
        """For peers."""
        return round(self.peer_wait_s / self.tick_s)

    @cached_property
    def look_back_ticks(self) -> int:
        """Before a frame is judged."""
        return math.ceil(self.look_back_s / self.tick_s - TICK_ROUNDING)

    @model_validator(mode="after")
    def _fits_the_models(self) -> Self:
        if (self.look_back_s + self.peer_wait_s) / self.tick_s > WAITING_MAX:
            raise ValueError(f"look_back_s and peer_wait_s hold more than {WAITING_MAX} ticks; make tick_s longer")
        for machine, model in self.loaded.items():
            if unknown := [name for name in model.features if name not in NUMBERS]:
                raise ValueError(f"the model of {machine} has the feature {unknown[0]!r}, which is no signal that is scored live")
            if self.common_mode is Method.FEATURES and model.preparation is None:
                raise ValueError(f"common_mode = features, but the model of {machine} was not trained for it: train it anew so")
            if model.calibration is not None and self.threshold is None:
                _check_settings(self, machine, model.calibration)
        return self


@lru_cache(maxsize=4)
def _models_in(folder: Path) -> "dict[str, AnomalyModel]":
    """Raises ValueError where the folder or a model cannot be read."""
    try:
        from twin.anomaly.model import load_models  # noqa: PLC0415  numpy comes with it
    except ImportError as error:
        raise ValueError(f"scoring needs {error.name}: pip install 'cnctwin[twin]'") from error
    try:
        return load_models(folder)
    except TwinError as error:
        raise ValueError(str(error)) from error


def _check_settings(config: Config, machine: str, calibration: "Calibration") -> None:
    """A threshold means so many alerts a week for the settings that it was fitted with, and nothing for others."""
    for key in FITTED_WITH:
        fitted, configured = getattr(calibration, key), getattr(config, key)
        if fitted != configured:
            raise ValueError(
                f"{key} = {configured}, but the threshold of {machine} was fitted with {fitted}: configure that, fit anew, "
                "or set threshold"
            )
