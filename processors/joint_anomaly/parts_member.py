"""The parts of one machine: its state between ticks, and what is published of it once the alarm is known.

    memory = followed(memory, seen);  own, record = learned(own, judged, alarm);  published alarm = alarm_of(memory)

The raw score is the machine's own, before its peers. The reason that is published is the strongest since the alarm came on; it
replaces the one before where it is `STRONGER` times as far from what was expected, so that a person can read it. An alarm that a
person has explained is held back, and its reason is published all the same (`twin/anomaly/parts/alarms/verdict.py`).
"""

from typing import TYPE_CHECKING, NamedTuple

from processors.contract import Output
from twin.anomaly.parts import scales
from twin.anomaly.parts.alarms.episodes import Memory, Seen, alarm_of, followed, is_excused, nearest, part_ended
from twin.anomaly.parts.alarms.feedback import told_of
from twin.anomaly.parts.alarms.signature import Signature, shares_of, signature_of
from twin.anomaly.parts.alarms.verdict import Verdict, corrected
from twin.anomaly.parts.alarms.why import Why
from twin.anomaly.parts.judging import Judged
from twin.anomaly.parts.learning import learned
from twin.anomaly.parts.moment import Place
from twin.anomaly.parts.own import Own
from twin.vocabulary import twin_signals

if TYPE_CHECKING:
    from processors.joint_anomaly.scoring import Scoring

RAW, WHY, KNOWS = twin_signals.RAW_SCORE, twin_signals.ANOMALY_WHY, twin_signals.ANOMALY_KNOWS
CUT_RECORD, VERDICTS = twin_signals.CUT_RECORD, twin_signals.ANOMALY_VERDICTS
NO_ALARM = "no alarm"
NO_REASON = "the score gives no reason"
NO_RECORD = "no operation has ended yet"
NOT_BY_PARTS = "only common_mode = parts tells"
STRONGER = 1.25


class PartsMember(NamedTuple):
    """model: whose state it is; part: the name of the part that runs
    why: the strongest reason since the alarm came on; is_shown: it is published; knows: as published last
    """

    own: Own
    model: str
    part: str = ""
    why: Why | None = None
    is_shown: bool = False
    knows: str = ""


class Learnt(NamedTuple):
    """is_alarm: as it is published; outputs: what there is to say"""

    parts: PartsMember
    is_alarm: bool
    outputs: list[Output]


def learnt(scoring: "Scoring", before: PartsMember | None, found: tuple[Own, Judged], is_on: bool, at_s: float) -> Learnt:
    """Return the state after a tick; is_on: the alarm by the score, whatever a person has said of it."""
    assert scoring.parts is not None
    (own, judged), name = found, scoring.machine
    before = PartsMember(own, scoring.parts_id) if before is None else before
    memory = _remembered(scoring, before, found, is_on, at_s)
    own, record = learned(
        scoring.parts,
        own._replace(memory=memory) if memory is not own.memory else own,
        judged,
        is_on and not is_excused(memory),
    )
    raw, is_alarm = judged.own_score, alarm_of(memory)
    outputs = [Output.null(RAW, judged.reason or "", name, at_s) if raw is None else Output(RAW, raw, machine=name, at_s=at_s)]
    why, is_shown = before.why, is_on or is_alarm
    if is_shown and (not before.is_shown or _is_stronger(judged.why, why)):
        why = judged.why and judged.why._replace(like=nearest(memory, _signature(scoring, own, judged)))
        outputs.append(_published(why, NO_REASON, name, at_s))
    elif before.is_shown and not is_shown:
        why = None
        outputs.append(_published(why, NO_ALARM, name, at_s))
    is_between_cuts = own.place.stood_ticks > 0 or own.place.tool is None
    knows = before.knows if is_between_cuts and before.knows else judged.knows
    if knows != before.knows:
        outputs.append(Output(KNOWS, knows, machine=name, at_s=at_s))
    if memory is not found[0].memory:
        outputs.append(Output(VERDICTS, told_of(memory, at_s), machine=name, at_s=at_s))
    if record is not None:
        outputs.append(Output(CUT_RECORD, record.in_json(), machine=name, at_s=at_s))
    after = PartsMember(own, scoring.parts_id, _part(before, own), why, is_shown, knows)
    return Learnt(after, is_alarm, outputs)


def spoken(scoring: "Scoring", before: PartsMember, verdict: Verdict, at_s: float) -> Learnt:
    """Return the state after a person's verdict on an alarm; at_s: event time of the last tick."""
    assert scoring.parts is not None
    own = corrected(scoring.parts, before.own, verdict)
    is_new = own.memory is not before.own.memory
    told = [Output(VERDICTS, told_of(own.memory, at_s), machine=scoring.machine, at_s=at_s)] if is_new else []
    return Learnt(before._replace(own=own), alarm_of(own.memory), told)


def introduced(scoring: "Scoring", member: PartsMember | None, is_by_parts: bool, no_model: str) -> list[Output]:
    """Return what there is to say of a machine's parts when it is born."""
    if not is_by_parts or scoring.parts is None:
        reason = NOT_BY_PARTS if scoring.model is not None else no_model
        return [Output.null(output, reason) for output in (WHY, KNOWS, CUT_RECORD, VERDICTS)]
    if member is None:
        nothing = [Output.null(WHY, NO_ALARM), Output.null(KNOWS, "nothing is known yet"), Output.null(CUT_RECORD, NO_RECORD)]
        return [*nothing, Output(VERDICTS, told_of(Memory(), 0.0))]
    reason = NO_REASON if member.is_shown else NO_ALARM
    return [_published(member.why, reason), Output(KNOWS, member.knows)]


def _remembered(scoring: "Scoring", before: PartsMember, found: tuple[Own, Judged], is_on: bool, at_s: float) -> Memory:
    """Return the memory of alarms after a tick."""
    own, judged = found
    memory, seen = own.memory, None
    if own.ended is not None and own.ended.is_part_over:
        memory = part_ended(memory, own.ended.place.program, before.part, at_s)
    if is_on and judged.score is None:
        return memory  # the alarm stays as it is while nothing is known
    if is_on and judged.score is not None and scoring.rule is not None:
        seen = Seen(judged.score, scoring.rule.threshold, _signature(scoring, own, judged), _part(before, own))
    return followed(memory, seen, at_s)


def _signature(scoring: "Scoring", own: Own, judged: Judged) -> Signature:
    assert scoring.parts is not None
    shares = shares_of(scoring.parts.signals, scales.SCALES, judged.signature)
    return signature_of(shares, own.place.key or "", own.place.program, own.place.tool)


def _part(before: PartsMember, own: Own) -> str:
    """Return the name of the part that runs: its program and the tick at which it began, as far as it was seen."""
    now, then = own.place, before.own.place
    if before.part and _number(now) == _number(then):
        return before.part
    return f"{now.program or '?'} from {own.tick}"


def _number(place: Place) -> tuple[str | None, int]:
    return place.program, place.part


def _published(why: Why | None, reason: str, machine: str | None = None, at_s: float | None = None) -> Output:
    return Output.null(WHY, reason, machine, at_s) if why is None else Output(WHY, why.in_json(), machine=machine, at_s=at_s)


def _is_stronger(new: Why | None, old: Why | None) -> bool:
    return new is not None and (old is None or abs(new.spreads) > STRONGER * abs(old.spreads))
