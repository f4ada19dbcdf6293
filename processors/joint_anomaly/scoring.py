"""The scoring of each machine: by which model, and when that is an alarm. Put together once, from the configuration and the
models that it names."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from processors.config import Configuration
from processors.joint_anomaly.config import FITTED_WITH, NUMBERS, Config
from processors.joint_anomaly.expectations import Expectations, read_expectations
from twin.anomaly.alarm import AlarmRule
from twin.anomaly.common_mode import Method
from twin.anomaly.parts.own import Own, begun
from twin.errors import TwinError

if TYPE_CHECKING:
    from twin.anomaly.model import AnomalyModel, Calibration
    from twin.anomaly.parts.model import PartsModel


@dataclass(frozen=True)
class Scoring:
    """The model and the alarm of one machine; rule: None where it has no threshold; expectations: of the twin, by program."""

    machine: str
    model: "AnomalyModel | None"
    rule: AlarmRule | None
    tick_s: float
    expectations: Expectations = field(default_factory=dict)

    @cached_property
    def calibration(self) -> "Calibration | None":
        """The calibration of the model."""
        return None if self.model is None else self.model.calibration

    @cached_property
    def parts(self) -> "PartsModel | None":
        """The usual values of the machine's parts, where its model compares parts."""
        return None if self.model is None else self.model.parts

    @cached_property
    def parts_id(self) -> str:
        """The first digits of the checksum of these; "" = there are none."""
        return "" if self.model is None else self.model.parts_id

    @cached_property
    def begun(self) -> Own:
        """The state of the machine's parts before anything was told."""
        assert self.parts is not None
        return begun(self.parts)

    @cached_property
    def calm_below(self) -> float:
        """Scores below it count towards the end of an alarm."""
        return 0.0 if self.rule is None else self.rule.clear_fraction * self.rule.threshold


def scoring_of(config: Configuration[Config], machine: str) -> Scoring:
    """Return how a machine is scored; one without a model is not."""
    scoring: Scoring | None = config.read.get(machine)
    return Scoring(machine, None, None, config.default.tick_s) if scoring is None else scoring


def scorings(
    config: Configuration[Config], models: "Mapping[str, AnomalyModel]", expected: Mapping[str, Expectations] | None = None
) -> dict[str, Scoring]:
    """Return how each machine that has a model is scored; expected: what the twin expects, by machine."""
    own = expected or {}
    return {machine: _scoring(config, machine, model, own.get(machine, {})) for machine, model in models.items()}


def read_scorings(config: Configuration[Config]) -> dict[str, Scoring]:
    """Return the scorings by the models in the configured folder. Raises ValueError where one cannot be read, or does not fit."""
    shared = config.default
    models = _models_in(Path(shared.models)) if shared.models else {}
    for machine, model in models.items():
        if unknown := [name for name in model.features if name not in NUMBERS]:
            raise ValueError(f"the model of {machine} has the feature {unknown[0]!r}, which is no signal that is scored live")
        if shared.common_mode is Method.FEATURES and model.preparation is None:
            raise ValueError(f"common_mode = features, but the model of {machine} was not trained for it: train it again so")
        if shared.common_mode is Method.PARTS:
            _check_parts(shared, machine, model)
        if model.calibration is not None and shared.threshold is None:
            _check_settings(shared, machine, model.calibration)
    return scorings(config, models, read_expectations(shared.expectations))


def _scoring(config: Configuration[Config], machine: str, model: "AnomalyModel", expected: Expectations) -> Scoring:
    shared, threshold = config.default, config.of(machine).threshold
    if threshold is None and model.calibration is not None:
        threshold = model.calibration.threshold
    rule = (
        None
        if threshold is None
        else AlarmRule(threshold, shared.dwell_ticks, shared.clear_fraction, round(shared.calm_s / shared.tick_s))
    )
    return Scoring(machine, model, rule, shared.tick_s, expected)


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


def _check_parts(config: Config, machine: str, model: "AnomalyModel") -> None:
    if model.parts is None:
        raise ValueError(
            f"common_mode = parts, but the model of {machine} was not trained for it: train it again, or set the common_mode "
            "that it was trained for"
        )
    if model.parts.tick_s != config.tick_s:
        raise ValueError(f"tick_s = {config.tick_s:g}, but the model of {machine} was trained with {model.parts.tick_s:g}")


def _check_settings(config: Config, machine: str, calibration: "Calibration") -> None:
    """A threshold means so many alerts a week for the settings that it was fitted with, and nothing for others."""
    for key in FITTED_WITH:
        fitted, configured = getattr(calibration, key), getattr(config, key)
        if fitted != configured:
            raise ValueError(
                f"{key} = {configured}, but the threshold of {machine} was fitted with {fitted}: configure that, fit again, "
                "or set threshold"
            )
