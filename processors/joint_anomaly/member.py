"""One machine of a cell: what of it is known, and what becomes of it when one of its scores has been judged beside its peers."""

from typing import NamedTuple

from processors.contract import Output
from processors.joint_anomaly.frames import NEVER, Ready, Scored
from processors.joint_anomaly.gate import Gate, Gated, GateRule, gated, restarted
from processors.joint_anomaly.parts_member import PartsMember, learnt
from processors.joint_anomaly.score_drift import Drift, drifted
from processors.joint_anomaly.scoring import Scoring
from sparkplug.quality import Quality
from twin.anomaly.alarm import AlarmState, after_tick
from twin.anomaly.parts.judging import Judged
from twin.anomaly.parts.own import Own
from twin.anomaly.preparation import Smoothed
from twin.vocabulary import twin_signals

ADJUSTED, COMMON, GATE = twin_signals.ADJUSTED_SCORE, twin_signals.COMMON_MODE, twin_signals.TOOL_CHANGE_GATE
GATE_SOURCE, PEER, PEERS = "twin/tool_change_gate_source", "twin/common_mode_peer", "twin/common_mode_peers"
ALARM, GATED_SHARE = twin_signals.ANOMALY_ALARM, twin_signals.GATED_SHARE_PCT
SHARE_S = 7 * 86_400.0
NO_MODEL = "no model for this machine; cnctwin train anomaly makes one"
NO_THRESHOLD = "the model has no threshold; cnctwin train anomaly fits one, or configure threshold"
NO_CALIBRATION = "no centre and spread: the model is not calibrated"
NO_PEER = "none"


class Adjustment(NamedTuple):
    """The score of a machine after those of its peers, and the peer that makes it common mode.

    score: None where it is not known, for the reason `why`; is_idle: nothing was judged, as in a gate
    smoothed: the features of the machine after this tick, where they are judged
    parts: its state after this tick and how it was judged, where parts are compared
    """

    score: float | None
    is_common: bool
    peer: str
    peers: int
    why: str | None = None
    is_idle: bool = False
    smoothed: Smoothed | None = None
    parts: tuple[Own, Judged] | None = None


class Published(NamedTuple):
    """The figures that were published last, beside the scores: they seldom change, and are published again when they do.

    unknown: why there is no adjusted score, and no common mode; alarm None: why there is no alarm
    """

    gate: Gated | None = None
    is_common: bool = False
    unknown: str | None = None
    peer: str = ""
    peers: int = -1
    alarm: bool | None = None
    why: str = ""
    share_pct: float = -1.0


class Member(NamedTuple):
    """The state of one machine.

    tick: the last one that it has come to; None while it is offline
    offset_ticks: its clock is ahead of that of its peers by so many
    young, ready: scores that wait for what a late label may say of them; and then for those of the peers
    judged: the last tick that was
    total_s, gated_s: of the last week, forgotten slowly
    description: the version that is live, as far as it was needed
    """

    tick: int | None = None
    offset_ticks: int = 0
    young: tuple[Scored, ...] = ()
    ready: tuple[Ready, ...] = ()
    gate: Gate = Gate()
    judged: int = NEVER
    alarm: AlarmState = AlarmState()
    total_s: float = 0.0
    gated_s: float = 0.0
    drift: Drift = Drift()
    told: Published = Published()
    smoothed: Smoothed | None = None
    parts: PartsMember | None = None
    description: str = ""

    def waiting_with(self, scored: Scored, rule: GateRule, look_back_ticks: int) -> "Member":
        """The machine with one more score. One that is older than the look-back is ready: whether it is gated stands."""
        young, ready = (*self.young, scored), self.ready
        while young and young[0].tick <= scored.tick - look_back_ticks:
            ready = (*ready, (young[0], gated(self.gate, rule, young[0].at_s)))
            young = young[1:]
        return Member(scored.tick, self.offset_ticks, young, ready, *self[4:])

    def offline(self, rule: GateRule) -> "Member":
        """The machine has gone, and will say no more of its scores."""
        labelled = tuple((scored, gated(self.gate, rule, scored.at_s)) for scored in self.young)
        return self._replace(tick=None, young=(), ready=self.ready + labelled)

    def set_back(self, at_s: float, offset_ticks: int) -> "Member":
        """The machine's clock has been set: its scores can't be put beside those of its peers any more."""
        return self._replace(
            tick=None, offset_ticks=offset_ticks, young=(), ready=(), gate=restarted(self.gate, at_s), smoothed=None
        )


def after(scoring: Scoring, member: Member, adjustment: Adjustment, outputs: list[Output]) -> Member:
    """The machine after the oldest of its ready scores was judged; what is new is added to the outputs.

    The dwell counts ticks in a row: one that is missing interrupts it like one that is gated.
    """
    tick, offset_ticks, young, ready, gate, judged, alarm, total_s, gated_s, drift, told, _, parts, description = member
    scored, label = ready[0]
    name, tick_s, at_s, adjusted, is_gated = scoring.machine, scoring.tick_s, scored.at_s, adjustment.score, label.is_on is True
    unknown, is_on, why = None, None, NO_MODEL if scoring.model is None else NO_THRESHOLD
    if adjusted is None:
        unknown = scored.reason or adjustment.why or NO_CALIBRATION
        outputs.append(Output.null(ADJUSTED, unknown, name, at_s))
    else:
        outputs.append(Output(ADJUSTED, adjusted, Quality.GOOD, None, name, at_s))
    if scoring.rule is not None:
        if scored.tick != judged + 1:
            alarm = after_tick(scoring.rule, alarm, None, True)
        is_idle = is_gated or adjustment.is_idle
        if alarm.is_on or adjusted is None or is_idle or adjusted >= scoring.calm_below or alarm.high_ticks:
            alarm = after_tick(scoring.rule, alarm, adjusted, is_idle)  # else it is off, and stays so
        is_on, why = (alarm.is_on, "") if alarm.is_on or unknown is None else (None, unknown)
    total_s = min(total_s + tick_s, SHARE_S)
    gated_s = gated_s * (1.0 - tick_s / SHARE_S) + (tick_s if is_gated else 0.0)
    raw = scored.raw
    if adjustment.parts is not None:
        raw = adjustment.parts[1].own_score
        parts, is_published, said = learnt(scoring, parts, adjustment.parts, alarm.is_on, at_s)
        outputs += said
        if scoring.rule is not None:
            is_on, why = (is_published, "") if is_published or unknown is None else (None, unknown)
    share_pct = min(round(200.0 * gated_s / total_s) / 2.0, 100.0)
    now = Published(label, adjustment.is_common, unknown, adjustment.peer, adjustment.peers, is_on, why, share_pct)
    if now != told:
        outputs += _news(name, at_s, now)
    drift, news = drifted(drift, scoring.calibration, None if is_gated else raw, at_s)
    outputs += [one._replace(machine=name) for one in news]
    news_and_state = (drift, now, adjustment.smoothed, parts, description)
    return Member(tick, offset_ticks, young, ready[1:], gate, scored.tick, alarm, total_s, gated_s, *news_and_state)


def _news(name: str, at_s: float, told: Published) -> list[Output]:
    """All of it; what readers know already is not sent again."""
    gate = told.gate
    assert gate is not None
    return [
        _known(GATE, gate.is_on, gate.reason or "", name, at_s),
        Output(GATE_SOURCE, gate.source, machine=name, at_s=at_s),
        _known(COMMON, told.is_common if told.unknown is None else None, told.unknown or "", name, at_s),
        Output(PEER, told.peer, machine=name, at_s=at_s),
        Output(PEERS, told.peers, machine=name, at_s=at_s),
        _known(ALARM, told.alarm, told.why, name, at_s),
        Output(GATED_SHARE, told.share_pct, machine=name, at_s=at_s),
    ]


def _known(name: str, value: bool | None, reason: str, machine: str, at_s: float) -> Output:
    return Output.null(name, reason, machine, at_s) if value is None else Output(name, value, machine=machine, at_s=at_s)
