"""The parts of one machine: its state between ticks, and what is published of it once the alarm is known.

The raw score is the machine's own, before its peers. The reason that is published is the strongest since the alarm came on; it
replaces the one before where it is `STRONGER` times as far from what was expected, so that a person can read it.
"""

from typing import TYPE_CHECKING, NamedTuple

from processors.contract import Output
from twin.anomaly.parts.judging import Judged
from twin.anomaly.parts.learning import learned
from twin.anomaly.parts.own import Own
from twin.anomaly.parts.why import Why
from twin.vocabulary import twin_signals

if TYPE_CHECKING:
    from processors.joint_anomaly.scoring import Scoring

RAW, WHY, KNOWS = twin_signals.RAW_SCORE, twin_signals.ANOMALY_WHY, twin_signals.ANOMALY_KNOWS
CUT_RECORD = twin_signals.CUT_RECORD
NO_ALARM = "no alarm"
NO_REASON = "the score gives no reason"
NO_RECORD = "no operation has ended yet"
NOT_BY_PARTS = "only common_mode = parts tells"
STRONGER = 1.25


class PartsMember(NamedTuple):
    """model: whose state it is; why: the strongest reason since the alarm came on; knows: as published last"""

    own: Own
    model: str
    why: Why | None = None
    is_alarm: bool = False
    knows: str = ""


def learnt(
    scoring: "Scoring", before: PartsMember | None, found: tuple[Own, Judged], is_alarm: bool, at_s: float
) -> tuple[PartsMember, list[Output]]:
    """Return the state after a tick whose alarm is known, and what there is to say of it."""
    assert scoring.parts is not None
    (own, judged), name = found, scoring.machine
    own, record = learned(scoring.parts, own, judged, is_alarm)
    why, was_alarm, knew = (None, False, "") if before is None else (before.why, before.is_alarm, before.knows)
    raw = judged.own_score
    outputs = [Output.null(RAW, judged.reason or "", name, at_s) if raw is None else Output(RAW, raw, machine=name, at_s=at_s)]
    if is_alarm and (not was_alarm or _is_stronger(judged.why, why)):
        why = judged.why
        outputs.append(_published(why, NO_REASON, name, at_s))
    elif was_alarm and not is_alarm:
        why = None
        outputs.append(_published(why, NO_ALARM, name, at_s))
    if judged.knows != knew:
        outputs.append(Output(KNOWS, judged.knows, machine=name, at_s=at_s))
    if record is not None:
        outputs.append(Output(CUT_RECORD, record.in_json(), machine=name, at_s=at_s))
    return PartsMember(own, scoring.parts_id, why, is_alarm, judged.knows), outputs


def _published(why: Why | None, reason: str, machine: str | None = None, at_s: float | None = None) -> Output:
    return Output.null(WHY, reason, machine, at_s) if why is None else Output(WHY, why.in_json(), machine=machine, at_s=at_s)


def _is_stronger(new: Why | None, old: Why | None) -> bool:
    return new is not None and (old is None or abs(new.spreads) > STRONGER * abs(old.spreads))


def told_of_parts(scoring: "Scoring", member: PartsMember | None, is_by_parts: bool, no_model: str) -> list[Output]:
    """Return what there is to say of a machine's parts when it is born."""
    if not is_by_parts or scoring.parts is None:
        reason = NOT_BY_PARTS if scoring.model is not None else no_model
        return [Output.null(output, reason) for output in (WHY, KNOWS, CUT_RECORD)]
    if member is None:
        return [Output.null(WHY, NO_ALARM), Output.null(KNOWS, "nothing is known yet"), Output.null(CUT_RECORD, NO_RECORD)]
    reason = NO_REASON if member.is_alarm else NO_ALARM
    return [_published(member.why, reason), Output(KNOWS, member.knows)]
