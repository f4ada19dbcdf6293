"""Anomaly scores of the machines of a cell, each beside its peers, and not while it changes its tool.

At each tick the features of a machine, as last reported, are scored by its model (`twin/anomaly/model.py`): the raw score, 0 = as
unusual as the model's contamination share of the training data, larger = worse. It is always published. Once all machines that
are in step have come to that tick (`processors/joint_anomaly/frames.py`), the frame is judged:

    adjusted = 0 where the score is common mode (`twin/anomaly/common_mode.py`) or gated (`processors/joint_anomaly/gate.py`),
               else raw

By default each cut is compared with the same cut of earlier parts instead, and with what the twin expects of it, less what the
peers share (`processors/joint_anomaly/parts.py`).

An adjusted score at or above the threshold in `dwell_ticks` ticks in a row is an alarm (`twin/anomaly/alarm.py`). The threshold
is fitted in alerts per machine-week on scores as they come out of this fold (`cnctwin train anomaly`); it holds for the settings
that it was fitted with only, so others are refused. Suppressing an alarm hides no data: raw score, adjusted score and the gate
are published side by side.
"""

import math
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from processors.config import Configuration
from processors.contract import CellProcessor, Output, OutputSpec, Provenance, Sample, SampleKind
from processors.joint_anomaly.config import NUMBERS, Config
from processors.joint_anomaly.expectations import DESCRIBED_BY, live_description
from processors.joint_anomaly.features import adjusted_by_features
from processors.joint_anomaly.frames import Frame, InStep, Scored, frames, in_step
from processors.joint_anomaly.gate import followed
from processors.joint_anomaly.introduction import BASIS, THRESHOLD, basis, introduction
from processors.joint_anomaly.member import (
    ADJUSTED,
    ALARM,
    COMMON,
    GATE,
    GATE_SOURCE,
    GATED_SHARE,
    NO_MODEL,
    NO_PEER,
    PEER,
    PEERS,
    Adjustment,
    Member,
    after,
)
from processors.joint_anomaly.moment import MOMENT_INPUTS, moment_of
from processors.joint_anomaly.parts import NO_PARTS, adjusted_by_parts
from processors.joint_anomaly.parts_member import CUT_RECORD, KNOWS, RAW, VERDICTS, WHY, spoken
from processors.joint_anomaly.score_drift import DRIFT
from processors.joint_anomaly.scoring import Scoring, read_scorings, scoring_of
from processors.plain_topic import topic_level
from processors.tool_change_detector.context import INPUTS as CONTEXT_INPUTS
from processors.tool_change_detector.context import tool_change_context
from sparkplug.datatype import DataType
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.anomaly.common_mode import Method, adjust_frame, standardised
from twin.anomaly.parts.alarms.verdict import verdict_of
from twin.anomaly.preparation import CONTEXT, Preparation, standardised_row
from twin.vocabulary.topics import VERDICT

CLOCK_OFFSET, STAMP_CLOCK = "clock_offset_s", "stamp_clock"
BY_EDGE = "edge"  # the control gives no stamps: its samples carry the edge's time, whatever its own clock shows
_VALUE, _QUALITY = Reading._fields.index("value"), Reading._fields.index("quality")
MEMBERS_MAX = 2000  # of a cell; those that are offline are forgotten when there are more
OFFSET_TICKS_MAX = 0.75  # that a clock's offset may change before it is a step of the clock
NOT_FINITE = "the model has no finite answer"


@dataclass(frozen=True, slots=True)
class State:
    """The machines of the cell, and who of them is in step."""

    members: Mapping[str, Member] = field(default_factory=dict)
    in_step: InStep = field(default_factory=InStep)


def step(config: Configuration[Config], state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Score at ticks; follow what is said of tool changes, and who is there; judge the frames that are complete."""
    if sample.is_history:
        return state, ()
    if sample.kind is SampleKind.TICK:
        return _ticked(config, state, sample)
    if sample.kind is SampleKind.PLAIN:
        return _spoken(config, state, sample)
    rule, machine, at_s = config.default.gate_rule, sample.machine, sample.at_s
    member = state.members.get(machine) or Member()
    member = member._replace(gate=followed(member.gate, rule, tool_change_context(sample.row), at_s))
    outputs: list[Output] = []
    if sample.kind is SampleKind.BIRTH:
        member = _placed(config.default, member, sample)
        member = member._replace(tick=_tick(config.default, member, at_s))
        outputs = introduction(config, machine, member)
    elif sample.kind is SampleKind.DEATH and machine not in sample.cell:
        member = member.offline(rule)
    elif sample.kind is SampleKind.HOLE and member.tick is not None and _tick(config.default, member, at_s) < member.tick:
        member = member.set_back(at_s, member.offset_ticks)
    members = {**state.members, machine: member}
    if machine not in state.members:
        members = _by_name(members, sample.cell)
    elif member.tick == state.members[machine].tick:
        return State(members, state.in_step), outputs
    return _together(config, members, outputs)


def _ticked(config: Configuration[Config], state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Score a machine; judge what its coming to this tick makes complete."""
    shared, machine = config.default, sample.machine
    scoring, step_before = scoring_of(config, machine), state.in_step
    member = _placed(shared, state.members.get(machine) or Member(), sample)
    before, tick = member.tick, _tick(shared, member, sample.at_s)
    is_by_parts = shared.common_mode is Method.PARTS
    scored = _told(scoring, sample, tick) if is_by_parts else _scored(scoring, sample, tick)
    members = {**state.members, machine: member.waiting_with(scored, shared.gate_rule, shared.look_back_ticks)}
    outputs = []
    if scoring.expectations and is_by_parts and (description := live_description(sample.row)) != member.description:
        members[machine] = members[machine]._replace(description=description)
        outputs.append(basis(config, scoring, description))
    if scored.moment is None:
        outputs.append(Output.null(RAW, scored.reason or "") if scored.raw is None else Output(RAW, scored.raw))
    step_now = step_before.moved(before, tick)
    if step_now is None:
        return _together(config, members, outputs)
    if not step_now.has(tick):
        _judge(config, members, (machine,), step_now, outputs)
    return State(members, step_now), outputs


def _by_name(members: dict[str, Member], online: Container[str]) -> dict[str, Member]:
    """Sort the members, lest their order be that of arrival; where they are too many, forget those that are offline."""
    kept = sorted(members if len(members) <= MEMBERS_MAX else [name for name in members if name in online])
    return {name: members[name] for name in kept}


def _spoken(config: Configuration[Config], state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Take a person's verdict on an alarm. Raises ValueError where it is none; one on a machine of another cell is passed by."""
    level = sample.topic.removeprefix(VERDICT)
    machine = next((name for name in state.members if topic_level(name) == level), "")
    scoring = scoring_of(config, machine)
    parts = state.members[machine].parts if machine else None
    if parts is None or scoring.parts is None or parts.model != scoring.parts_id:
        return state, ()
    member = state.members[machine]
    at_s = (member.judged + member.offset_ticks) * config.default.tick_s
    parts, is_alarm, outputs = spoken(scoring, parts, verdict_of(sample.detail), at_s)
    told = member.told if member.told.alarm is None else member.told._replace(alarm=is_alarm)
    if told != member.told:
        outputs.append(Output(ALARM, is_alarm, machine=machine, at_s=at_s))
    return State({**state.members, machine: member._replace(parts=parts, told=told)}, state.in_step), outputs


def _together(config: Configuration[Config], members: dict[str, Member], outputs: list[Output]) -> tuple[State, list[Output]]:
    """Find out who is in step, and judge the frames that are complete by that."""
    ticks = [one.tick for one in members.values() if one.tick is not None]
    found = in_step(ticks, config.default.wait_ticks)
    _judge(config, members, members, found, outputs)
    return State(members, found), outputs


def _placed(shared: Config, member: Member, sample: Sample) -> Member:
    """The machine, whose clock may have been found to be ahead of that of its peers by another number of ticks than before."""
    if CLOCK_OFFSET not in sample.row:
        return member
    stamped_by = sample.row.get(STAMP_CLOCK)
    is_by_edge = stamped_by is not None and stamped_by.value == BY_EDGE
    offset_s = 0.0 if is_by_edge else sample.number(CLOCK_OFFSET)[0]
    if offset_s is None or abs(offset_s / shared.tick_s - member.offset_ticks) <= OFFSET_TICKS_MAX:
        return member
    return member.set_back(sample.at_s, round(offset_s / shared.tick_s))


def _tick(shared: Config, member: Member, at_s: float) -> int:
    """The last tick of a machine at its time, by the clock that the peers have too."""
    return round(at_s * 1000.0) // shared.tick_ms - member.offset_ticks


def _told(scoring: Scoring, sample: Sample, tick: int) -> Scored:
    """Return what a machine told as of a tick; its score waits until the ticks before it are judged."""
    if scoring.parts is None:
        return Scored(tick, sample.at_s, None, NO_MODEL if scoring.model is None else NO_PARTS)
    return Scored(tick, sample.at_s, None, moment=moment_of(scoring.parts.signals, sample))


def _scored(scoring: Scoring, sample: Sample, tick: int) -> Scored:
    """The raw score of a machine as of a tick. A model that fails concerns its own machine only."""
    model = scoring.model
    if model is None:
        return Scored(tick, sample.at_s, None, NO_MODEL)
    row, values = sample.row, []
    for name in model.features:
        reading = row.get(name)
        value = None if reading is None or reading[_QUALITY] is not Quality.GOOD else reading[_VALUE]
        if type(value) is not float or not -math.inf < value < math.inf:  # a float is what nearly every reading is
            value, why = sample.number(name)
            if value is None:
                return Scored(tick, sample.at_s, None, why)
        values.append(value)
    try:
        now = None if model.preparation is None else standardised_row(model.preparation, values, _context(model.preparation, row))
        raw = model.score_one(values if now is None else now.values)
    except Exception as error:  # whatever a library does with these values
        return Scored(tick, sample.at_s, None, f"the model fails: {type(error).__name__}")
    return Scored(tick, sample.at_s, raw, None, now) if math.isfinite(raw) else Scored(tick, sample.at_s, None, NOT_FINITE)


def _context(preparation: Preparation, row: Mapping[str, Reading]) -> list[object]:
    """Return the values that name the regime; None where it is not known."""
    readings = [row.get(name) for name in preparation.context]
    return [None if one is None or one.quality is not Quality.GOOD else one.value for one in readings]


def _judge(
    config: Configuration[Config], members: dict[str, Member], names: Iterable[str], step_now: InStep, outputs: list[Output]
) -> None:
    """Judge what is complete of these machines; the members are replaced, what came of it is added to the outputs."""
    shared = config.default
    ready = {name: members[name].ready for name in names if members[name].ready}
    for frame in frames(ready, step_now, shared.look_back_ticks):
        scorings = {name: scoring_of(config, name) for name in frame}
        if shared.common_mode is Method.PARTS:
            found = adjusted_by_parts(scorings, frame, members)
        elif shared.common_mode is Method.FEATURES:
            found = adjusted_by_features(scorings, frame, members)
        else:
            found = _adjusted_by_scores(shared, scorings, frame)
        for name, scoring in scorings.items():
            members[name] = after(scoring, members[name], found[name], outputs)


def _adjusted_by_scores(shared: Config, scorings: Mapping[str, Scoring], frame: Frame) -> dict[str, Adjustment]:
    """Return the score of each machine of a frame by the published rule, or by the residual of the scores."""
    names = list(scorings)
    scores = [_on_the_scale(shared, scoring, frame[name][0].raw) for name, scoring in scorings.items()]
    judged = adjust_frame(shared.common_mode_rule, scores, [frame[name][1].is_on is True for name in names])
    return {
        name: Adjustment(
            one.score, one.is_common, names[one.peer] if one.is_common and one.peer is not None else NO_PEER, one.peers
        )
        for name, one in zip(names, judged, strict=True)
    }


def _on_the_scale(shared: Config, scoring: Scoring, raw: float | None) -> float | None:
    """The raw score for the published rule; for the residual, how many spreads it lies above its centre."""
    if raw is None or shared.common_mode is Method.SOURCE:
        return raw
    calibration = scoring.calibration
    return None if calibration is None else standardised(raw, calibration.raw_center, calibration.raw_spread)


def _specs() -> tuple[OutputSpec, ...]:
    inferred, text, number = Provenance.INFERRED, DataType.STRING, DataType.DOUBLE
    return (
        OutputSpec(
            RAW, number, None, "how unusual the machine is by itself; larger = worse (parts: in tails of healthy parts)", inferred
        ),
        OutputSpec(
            ADJUSTED, number, None, "raw score; 0 while it is common mode or gated (residual: spreads over the peers)", inferred
        ),
        OutputSpec(COMMON, DataType.BOOLEAN, None, "peers are as unusual: no fault of this machine", inferred),
        OutputSpec(
            PEER,
            text,
            None,
            "the peer that makes the score common mode, the largest of them",
            inferred,
        ),
        OutputSpec(PEERS, DataType.INT64, None, "how many peers had a score as of the same tick", inferred),
        OutputSpec(GATE, DataType.BOOLEAN, None, "a tool change, its look-back or its tail: scores are not judged", inferred),
        OutputSpec(GATE_SOURCE, text, None, "who says so: controller, detector, none or stale", inferred),
        OutputSpec(GATED_SHARE, number, "%", "share of the last week that was gated", inferred, 0.5),
        OutputSpec(
            ALARM, DataType.BOOLEAN, None, "the adjusted score has been at the threshold for the dwell", inferred, is_alarm=True
        ),
        OutputSpec(
            WHY, text, None, "JSON, while an alarm is on: which signal, which cut, how far from what was expected", inferred
        ),
        OutputSpec(
            KNOWS, text, None, "how much the score knows of the operation that runs: parts, the twin only, nothing", inferred
        ),
        OutputSpec(
            CUT_RECORD, text, None, "JSON, at the end of an operation: its load, vibration, feed over earlier parts", inferred
        ),
        OutputSpec(VERDICTS, text, None, "JSON: the last alarms, what people have said of them, and what came of it", inferred),
        OutputSpec(THRESHOLD, number, None, "of the adjusted score", inferred),
        OutputSpec(BASIS, text, None, "what the score and its threshold rest on", inferred),
        OutputSpec(
            DRIFT, DataType.BOOLEAN, None, "raw scores have left what they were in the golden week", inferred, is_alarm=True
        ),
    )


PROCESSOR = CellProcessor(
    name="joint_anomaly",
    version=3,
    inputs=NUMBERS | CONTEXT_INPUTS | {CLOCK_OFFSET, STAMP_CLOCK, *CONTEXT, DESCRIBED_BY} | MOMENT_INPUTS,
    outputs=_specs(),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
    wakes=CONTEXT_INPUTS,
    listens=(f"{VERDICT}+",),
    reads=read_scorings,
)
