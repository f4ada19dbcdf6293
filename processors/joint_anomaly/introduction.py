"""The outputs that explain a machine's scores: threshold and basis, once it is born and when what they rest on changes."""

from processors.config import Configuration
from processors.contract import Output
from processors.joint_anomaly.config import Config
from processors.joint_anomaly.expectations import basis_of
from processors.joint_anomaly.member import NO_MODEL, NO_THRESHOLD, Member
from processors.joint_anomaly.parts_member import introduced
from processors.joint_anomaly.score_drift import DRIFT, NO_GOLDEN_WEEK
from processors.joint_anomaly.scoring import Scoring, scoring_of
from twin.anomaly.common_mode import Method
from twin.vocabulary import twin_signals

THRESHOLD, BASIS = twin_signals.ANOMALY_THRESHOLD, twin_signals.ANOMALY_BASIS


def introduction(config: Configuration[Config], machine: str, member: Member) -> list[Output]:
    """Return the outputs that explain a machine's scores."""
    scoring = scoring_of(config, machine)
    parts = introduced(scoring, member.parts, config.default.common_mode is Method.PARTS, NO_MODEL)
    if scoring.model is None:
        return [Output.null(THRESHOLD, NO_MODEL), Output(BASIS, NO_MODEL), *parts]
    threshold = Output.null(THRESHOLD, NO_THRESHOLD) if scoring.rule is None else Output(THRESHOLD, scoring.rule.threshold)
    drift = [Output.null(DRIFT, NO_GOLDEN_WEEK)] if scoring.model.calibration is None else []
    return [threshold, basis(config, scoring, member.description), *drift, *parts]


def basis(config: Configuration[Config], scoring: Scoring, description: str) -> Output:
    """Return what the scores of a machine rest on; description: the version that is live, "" = not known."""
    shared, model = config.default, scoring.model
    assert model is not None
    fitted = "configured" if config.of(scoring.machine).threshold is not None else "not fitted"
    if fitted == "not fitted" and model.calibration is not None:
        fitted = model.calibration.in_words
    if shared.common_mode is Method.PARTS:
        common = basis_of(scoring.expectations, description)
    else:
        common = f"common mode by {shared.common_mode.value}, factor {shared.common_mode_factor:g}"
    gate = f"gate tail {shared.tail_s:g} s, look-back {shared.look_back_s:g} s"
    return Output(BASIS, f"{model.in_words}; threshold {fitted}; {common}; {gate}")
