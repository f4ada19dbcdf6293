"""One machine of a cell: what of it is known, and what becomes of it when one of its scores has been judged beside its peers."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from processors.contract import Output
from processors.joint_frames import PENDING_MAX, Pending, Scored
from processors.score_drift import Drift, drifted
from processors.tool_change_gate import Gate, Gated
from twin.anomaly.alarm import AlarmRule, AlarmState, after_tick

if TYPE_CHECKING:
    from twin.anomaly.model import AnomalyModel, Calibration

ADJUSTED, COMMON, GATE = "twin/adjusted_score", "twin/common_mode", "twin/tool_change_gate"
GATE_SOURCE, PEER, PEERS = "twin/tool_change_gate_source", "twin/common_mode_peer", "twin/common_mode_peers"
ALARM, GATED_SHARE = "twin/anomaly_alarm", "twin/gated_share_pct"
SHARE_S = 7 * 86_400.0
NO_MODEL = "no model for this machine; cnctwin train anomaly makes one"
NO_THRESHOLD = "the model has no threshold; cnctwin train anomaly fits one, or configure threshold"


@dataclass(frozen=True)
class Seat:
    """What the configuration says of one machine; rule: None where it has no threshold."""

    machine: str
    model: "AnomalyModel | None"
    rule: AlarmRule | None

    @cached_property
    def calibration(self) -> "Calibration | None":
        """Of the model."""
        return None if self.model is None else self.model.calibration


class Judged(NamedTuple):
    """A score beside its peers, and whether it counts; adjusted None = not known."""

    scored: Scored
    gate: Gated
    adjusted: float | None
    is_common: bool
    peer: str
    peers: int


class Told(NamedTuple):
    """What readers were told last, beside the scores: it seldom changes, and is told again when it does."""

    gate: Gated | None = None
    is_common: bool = False
    peer: str = ""
    peers: int = -1
    alarm: bool | None = None
    why: str = ""
    share_pct: float = -1.0


class Member(NamedTuple):
    """What is known of one machine.

    tick: the last one that it has come to; None until one was, and after a jump of its clock
    pending: scores that wait for those of the peers
    total_s, gated_s: of the last week, forgotten slowly
    """

    tick: int | None = None
    pending: Pending = ()
    gate: Gate = Gate()
    alarm: AlarmState = AlarmState()
    total_s: float = 0.0
    gated_s: float = 0.0
    drift: Drift = Drift()
    told: Told = Told()

    def waiting_with(self, scored: Scored) -> "Member":
        """The member with one more score that waits."""
        pending = (*self.pending, scored)
        if len(pending) > PENDING_MAX:
            pending = pending[1:]
        return Member(scored.tick, pending, *self[2:])


def after(seat: Seat, member: Member, judged: Judged, tick_s: float, outputs: list[Output]) -> Member:
    """The machine after the oldest of its waiting scores was judged; what is new is added to the outputs."""
    scored, gate, adjusted, is_common, peer, peers = judged
    name, at_s, is_gated = seat.machine, scored.at_s, gate.is_on is True
    alarm, is_on, why = member.alarm, None, NO_THRESHOLD if seat.model is not None else NO_MODEL
    if seat.rule is not None:
        alarm = after_tick(seat.rule, alarm, adjusted, is_gated)
        if alarm.is_on or adjusted is not None:
            is_on, why = alarm.is_on, ""
        else:
            why = scored.reason or "no adjusted score"
    total_s = min(member.total_s + tick_s, SHARE_S)
    gated_s = member.gated_s * (1.0 - tick_s / SHARE_S) + (tick_s if is_gated else 0.0)
    share_pct = min(round(200.0 * gated_s / total_s) / 2.0, 100.0)
    drift, news = drifted(member.drift, seat.model, None if is_gated else scored.raw, at_s)
    if adjusted is None:
        outputs.append(Output.null(ADJUSTED, scored.reason or "no centre and spread: the model is not calibrated", name, at_s))
    else:
        outputs.append(Output(ADJUSTED, adjusted, machine=name, at_s=at_s))
    told = Told(gate, is_common, peer, peers, is_on, why, share_pct)
    if told != member.told:
        outputs += _news(name, at_s, told)
    outputs += [one._replace(machine=name) for one in news]
    return Member(member.tick, member.pending[1:], member.gate, alarm, total_s, gated_s, drift, told)


def _news(name: str, at_s: float, told: Told) -> list[Output]:
    """All of it; what readers know already is not sent again."""
    gate = told.gate
    assert gate is not None
    return [
        _known(GATE, gate.is_on, gate.reason or "", name, at_s),
        Output(GATE_SOURCE, gate.source, machine=name, at_s=at_s),
        Output(COMMON, told.is_common, machine=name, at_s=at_s),
        Output(PEER, told.peer, machine=name, at_s=at_s),
        Output(PEERS, told.peers, machine=name, at_s=at_s),
        _known(ALARM, told.alarm, told.why, name, at_s),
        Output(GATED_SHARE, told.share_pct, machine=name, at_s=at_s),
    ]


def _known(name: str, value: bool | None, reason: str, machine: str, at_s: float) -> Output:
    return Output.null(name, reason, machine, at_s) if value is None else Output(name, value, machine=machine, at_s=at_s)
