"""How unusual each machine of a cell is, beside its peers, and not while it changes its tool.

At each tick the features of a machine, as last reported, are scored by its model (`twin/anomaly/model.py`): the raw score, 0 = as
unusual as the model's contamination share of the training data, larger = worse. It is always published. Once all machines that
are in step have come to that tick (`processors/joint_frames.py`), the frame is judged:

    adjusted = 0 where the score is common mode (`twin/anomaly/common_mode.py`) or gated (`processors/tool_change_gate.py`),
               else raw

An adjusted score at or above the threshold in `dwell_ticks` ticks in a row is an alarm (`twin/anomaly/alarm.py`). The threshold
is fitted in alerts per machine-week on scores as they come out of this fold (`cnctwin train anomaly`); it holds for the settings
that it was fitted with only, so others are refused. Suppressing an alarm hides no data: raw score, adjusted score and the gate
are published side by side.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self

from pydantic import Field, PositiveFloat, model_validator

from processors.config import CellConfig, Configuration
from processors.contract import CellProcessor, Output, OutputSpec, Provenance, Sample, SampleKind
from processors.joint_frames import PENDING_MAX, Pending, Scored, frames, limits, without
from processors.score_drift import Drift, drifted
from processors.tool_change_context import INPUTS as CONTEXT_INPUTS
from processors.tool_change_context import tool_change_context
from processors.tool_change_gate import Gate, Gated, GateRule, followed, gated, restarted
from sparkplug.datatype import DataType
from twin.anomaly.alarm import AlarmRule, AlarmState, after_tick
from twin.anomaly.common_mode import Adjusted, CommonModeRule, Method, adjust_frame, standardised

if TYPE_CHECKING:
    from twin.anomaly.model import AnomalyModel, Calibration

RAW, ADJUSTED, COMMON, GATE = "twin/raw_score", "twin/adjusted_score", "twin/common_mode", "twin/tool_change_gate"
GATE_SOURCE, PEER, PEERS = "twin/tool_change_gate_source", "twin/common_mode_peer", "twin/common_mode_peers"
ALARM, THRESHOLD, BASIS = "twin/anomaly_alarm", "twin/anomaly_threshold", "twin/anomaly_basis"
GATED_SHARE, DRIFT = "twin/gated_share_pct", "twin/score_drift"
CLOCK_OFFSET = "clock_offset_s"
SHARE_S = 7 * 86_400.0
NO_MODEL = "no model for this machine; cnctwin train anomaly makes one"
NO_THRESHOLD = "the model has no threshold; cnctwin train anomaly fits one, or configure threshold"
NUMBERS = frozenset(
    {
        *("spindle_rpm", "spindle_rpm_cmd", "spindle_load_pct", "spindle_power_kw", "spindle_current_a", "feed_mm_min"),
        *("feed_override_pct", "rapid_override_pct", "spindle_override_pct", "spindle_temp_c", "ambient_temp_c"),
        *("vibration_rms_g", "vibration_velocity_mm_s"),
        *(f"axis_{axis}_load_pct" for axis in "xyzabc"),
        *("twin/vibration_rms_g", "twin/vibration_velocity_mm_s", "twin/vibration_crest_factor", "twin/vibration_kurtosis"),
        *("twin/spindle_temp_residual_k", "twin/cutting_force_n"),
    }
)
"""What a model may have as features."""


class Config(CellConfig):
    """Which models score, what is common mode, when the gate is shut, when a score is an alarm.

    models: folder with one model for each machine, by name; "" = none: every score is null then, and says so
    threshold: in units of the adjusted score; absent = that of the model
    peer_wait_s: how long a frame waits for the peers, in event time
    """

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
        return GateRule(self.tail_s, self.look_back_s, self.gate_s_max)

    @cached_property
    def common_mode_rule(self) -> CommonModeRule:
        """What is common mode."""
        return CommonModeRule(self.common_mode, self.common_mode_factor, self.exclude_gated_peers)

    @cached_property
    def alarm_rules(self) -> dict[float, AlarmRule]:
        """Made as they are needed: by threshold."""
        return {}

    @cached_property
    def wait_ticks(self) -> int:
        """For peers."""
        return round(self.peer_wait_s / self.tick_s)

    @cached_property
    def look_back_ticks(self) -> int:
        """Before a frame is judged."""
        return -round(-self.look_back_s // self.tick_s)

    @model_validator(mode="after")
    def _fits_the_models(self) -> Self:
        if (self.look_back_s + self.peer_wait_s) / self.tick_s > PENDING_MAX / 4:
            raise ValueError(f"look_back_s and peer_wait_s hold more than {PENDING_MAX // 4} ticks; make tick_s longer")
        for machine, model in self.loaded.items():
            if unknown := [name for name in model.features if name not in NUMBERS]:
                raise ValueError(f"the model of {machine} has the feature {unknown[0]!r}, which is no signal that is scored live")
            if model.calibration is not None and self.threshold is None:
                _check_settings(self, machine, model.calibration)
        return self


class Member(NamedTuple):
    """What is known of one machine.

    tick: the last one that was scored; None until one was, and after a jump of its clock
    total_s, gated_s: of the last week, forgotten slowly
    """

    tick: int | None = None
    pending: Pending = ()
    gate: Gate = Gate()
    alarm: AlarmState = AlarmState()
    total_s: float = 0.0
    gated_s: float = 0.0
    drift: Drift = Drift()


class Judged(NamedTuple):
    """A score beside its peers, and whether it counts."""

    scored: Scored
    gate: Gated
    adjusted: Adjusted


@dataclass(frozen=True, slots=True)
class State:
    """The machines of the cell."""

    members: Mapping[str, Member] = field(default_factory=dict)


def step(config: Configuration[Config], state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Follow the gate with every sample; score at ticks; judge the frames that are complete."""
    kind, machine, shared = sample.kind, sample.machine, config.default
    if sample.is_history or (kind is SampleKind.DATA and CONTEXT_INPUTS.isdisjoint(sample.changed)):
        return state, ()
    member = state.members.get(machine, Member())
    if kind is SampleKind.HOLE and sample.gap_s:
        member = member._replace(
            tick=None, pending=(), gate=restarted(member.gate, sample.at_s), alarm=_interrupted(member.alarm)
        )
    gate = followed(member.gate, shared.gate_rule, tool_change_context(sample.row), sample.at_s)
    member = member._replace(gate=gate) if gate is not member.gate else member
    if kind is SampleKind.DEATH and machine not in state.members:
        return state, ()
    if kind is SampleKind.BIRTH:
        passed = _tick(shared, sample, math.floor)
        member = member._replace(tick=passed if member.tick is None else max(passed, member.tick))
    if kind is not SampleKind.TICK:
        known = {name: one for name, one in state.members.items() if name in sample.cell}
        return State({**known, machine: member}), _told(config, machine) if kind is SampleKind.BIRTH else ()
    scored = _scored(shared, sample)
    if member.tick is not None and scored.tick <= member.tick:
        return State({**state.members, machine: member}), ()
    member = member._replace(tick=scored.tick, pending=(*member.pending, scored)[-PENDING_MAX:])
    raw = Output.null(RAW, scored.reason or "") if scored.raw is None else Output(RAW, scored.raw)
    return _judged(config, {**state.members, machine: member}, sample, raw)


def _tick(shared: Config, sample: Sample, whole: Callable[[float], int]) -> int:
    """The number of the tick of a sample, on the clock that the peers have too."""
    offset_s, _ = sample.number(CLOCK_OFFSET)
    return whole((sample.at_s - (offset_s or 0.0)) / shared.tick_s)


def _scored(shared: Config, sample: Sample) -> Scored:
    """The raw score of a machine as of a tick."""
    tick = _tick(shared, sample, round)
    model = shared.loaded.get(sample.machine)
    if model is None:
        return Scored(tick, sample.at_s, None, NO_MODEL)
    values = []
    for name in model.features:
        value, why = sample.number(name)
        if value is None:
            return Scored(tick, sample.at_s, None, why)
        values.append(value)
    return Scored(tick, sample.at_s, model.score_one(values))


def _judged(
    config: Configuration[Config], members: dict[str, Member], sample: Sample, raw: Output
) -> tuple[State, Sequence[Output]]:
    """The state after judging all frames that are complete now; what came of it."""
    shared = config.default
    last = {name: one.tick for name, one in members.items() if one.tick is not None and name in sample.cell}
    limit = limits(last, shared.wait_ticks, shared.look_back_ticks)
    outputs = [raw]
    for frame in frames({name: members[name].pending for name in limit}, limit):
        outputs += _frame(config, members, frame)
    for name, up_to in limit.items():
        waiting = members[name].pending
        if waiting and waiting[0].tick <= up_to:
            members[name] = members[name]._replace(pending=without(waiting, up_to))
    return State(members), outputs


def _frame(config: Configuration[Config], members: dict[str, Member], frame: Mapping[str, Scored]) -> list[Output]:
    """Judge the scores of one tick beside each other; the members are replaced."""
    shared = config.default
    names = list(frame)
    gates = [gated(members[name].gate, shared.gate_rule, frame[name].at_s) for name in names]
    scores = [_on_the_scale(shared, name, frame[name].raw) for name in names]
    outputs: list[Output] = []
    judged = adjust_frame(shared.common_mode_rule, scores, [gate.is_on is True for gate in gates])
    for name, gate, adjusted in zip(names, gates, judged, strict=True):
        peer = "none" if adjusted.peer is None else names[adjusted.peer]
        at_s = frame[name].at_s
        members[name], own = _member(config, name, members[name], Judged(frame[name], gate, adjusted))
        outputs += own
        outputs += [
            Output(COMMON, adjusted.is_common, machine=name, at_s=at_s),
            Output(PEER, peer, machine=name, at_s=at_s),
            Output(PEERS, adjusted.peers, machine=name, at_s=at_s),
        ]
    return outputs


def _on_the_scale(shared: Config, name: str, raw: float | None) -> float | None:
    """The raw score for the published rule; for the residual, how many spreads it lies above its centre."""
    if raw is None or shared.common_mode is Method.SOURCE:
        return raw
    calibration = shared.loaded[name].calibration
    return None if calibration is None else standardised(raw, calibration.raw_center, calibration.raw_spread)


def _member(config: Configuration[Config], name: str, member: Member, judged: Judged) -> tuple[Member, list[Output]]:
    """A machine after one of its scores was judged; its adjusted score, its gate and its alarm."""
    scored, gate, adjusted = judged
    shared, at_s = config.default, scored.at_s
    threshold = _threshold(config, name)
    is_gated = gate.is_on is True
    outputs = [
        _or_null(ADJUSTED, adjusted.score, scored.reason or "no z without the centre and spread of a calibration", name, at_s),
        _or_null(GATE, gate.is_on, gate.reason or "", name, at_s),
        Output(GATE_SOURCE, gate.source, machine=name, at_s=at_s),
    ]
    alarm = member.alarm
    if threshold is None:
        outputs.append(Output.null(ALARM, NO_MODEL if name not in shared.loaded else NO_THRESHOLD, name, at_s))
    else:
        alarm = after_tick(_alarm_rule(shared, threshold), alarm, adjusted.score, is_gated)
        known = alarm.is_on if alarm.is_on or adjusted.score is not None else None
        outputs.append(_or_null(ALARM, known, scored.reason or "no adjusted score", name, at_s))
    total_s = min(member.total_s + shared.tick_s, SHARE_S)
    gated_s = member.gated_s + (shared.tick_s if is_gated else 0.0) - (member.gated_s * shared.tick_s / SHARE_S)
    share_pct = min(100.0 * gated_s / total_s, 100.0)
    drift, told = drifted(member.drift, shared.loaded.get(name), None if is_gated else scored.raw, at_s)
    outputs += [Output(GATED_SHARE, round(share_pct, 2), machine=name, at_s=at_s), *(one._replace(machine=name) for one in told)]
    return member._replace(alarm=alarm, total_s=total_s, gated_s=gated_s, drift=drift), outputs


def _or_null(name: str, value: float | bool | None, reason: str, machine: str, at_s: float) -> Output:
    return Output.null(name, reason, machine, at_s) if value is None else Output(name, value, machine=machine, at_s=at_s)


def _threshold(config: Configuration[Config], name: str) -> float | None:
    """The configured threshold, else that of the model; None where neither is there."""
    shared = config.default
    configured = config.of(name).threshold
    model = shared.loaded.get(name)
    if model is None:
        return None
    if configured is not None:
        return configured
    return None if model.calibration is None else model.calibration.threshold


def _alarm_rule(shared: Config, threshold: float) -> AlarmRule:
    rule = shared.alarm_rules.get(threshold)
    if rule is None:
        rule = shared.alarm_rules[threshold] = AlarmRule(threshold, shared.dwell_ticks, shared.clear_fraction)
    return rule


def _interrupted(alarm: AlarmState) -> AlarmState:
    return AlarmState(alarm.is_on)


def _told(config: Configuration[Config], machine: str) -> list[Output]:
    """What a reader of a machine has to know of its scores, once."""
    shared, threshold = config.default, _threshold(config, machine)
    model = shared.loaded.get(machine)
    if model is None:
        return [Output.null(THRESHOLD, NO_MODEL), Output(BASIS, NO_MODEL)]
    found = model.calibration
    fitted = "not fitted" if found is None or config.of(machine).threshold is not None else found.in_words
    common = f"common mode by {shared.common_mode.value}, factor {shared.common_mode_factor:g}"
    basis = f"{model.in_words}; threshold {fitted}; {common}; gate tail {shared.tail_s:g} s, look-back {shared.look_back_s:g} s"
    return [_or_null(THRESHOLD, threshold, NO_THRESHOLD, machine, 0.0)._replace(at_s=None), Output(BASIS, basis)]


def _models_in(folder: Path) -> "dict[str, AnomalyModel]":
    """Raises ValueError where the folder or a model cannot be read."""
    try:
        from twin.anomaly.model import load_models  # noqa: PLC0415  numpy comes with it
    except ImportError as error:
        raise ValueError(f"scoring needs {error.name}: pip install 'cnctwin[twin]'") from error
    return load_models(folder)


def _check_settings(config: Config, machine: str, calibration: "Calibration") -> None:
    """A threshold means so many alerts a week for the settings that it was fitted with, and nothing for others."""
    for key in (
        "tick_s",
        "dwell_ticks",
        "clear_fraction",
        "common_mode",
        "common_mode_factor",
        "exclude_gated_peers",
        "tail_s",
        "look_back_s",
    ):
        fitted, configured = getattr(calibration, key), getattr(config, key)
        if fitted != configured:
            raise ValueError(
                f"{key} = {configured}, but the threshold of {machine} was fitted with {fitted}: configure that, fit anew, "
                "or set threshold"
            )


def _specs() -> tuple[OutputSpec, ...]:
    inferred, text, number = Provenance.INFERRED, DataType.STRING, DataType.DOUBLE
    return (
        OutputSpec(
            RAW, number, None, "how unusual the machine is: 0 = at the contamination share of training, larger = worse", inferred
        ),
        OutputSpec(
            ADJUSTED, number, None, "raw score; 0 while it is common mode or gated (residual: spreads over the peers)", inferred
        ),
        OutputSpec(COMMON, DataType.BOOLEAN, None, "peers are as unusual: no fault of this machine", inferred),
        OutputSpec(PEER, text, None, "the peer with the largest score that counted", inferred),
        OutputSpec(PEERS, DataType.INT64, None, "how many peers had a score as of the same tick", inferred),
        OutputSpec(GATE, DataType.BOOLEAN, None, "a tool change, its look-back or its tail: scores are not judged", inferred),
        OutputSpec(GATE_SOURCE, text, None, "who says so: controller, detector, none or stale", inferred),
        OutputSpec(GATED_SHARE, number, "%", "share of the last week that was gated", inferred, 0.5),
        OutputSpec(
            ALARM, DataType.BOOLEAN, None, "the adjusted score has been at the threshold for the dwell", inferred, is_alarm=True
        ),
        OutputSpec(THRESHOLD, number, None, "of the adjusted score", inferred),
        OutputSpec(BASIS, text, None, "what the score and its threshold rest on", inferred),
        OutputSpec(
            DRIFT, DataType.BOOLEAN, None, "raw scores have left what they were in the golden week", inferred, is_alarm=True
        ),
    )


PROCESSOR = CellProcessor(
    name="joint_anomaly",
    version=1,
    inputs=NUMBERS | CONTEXT_INPUTS | {CLOCK_OFFSET},
    outputs=_specs(),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
)
