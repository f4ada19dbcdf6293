"""What comes on cnctwin/alerts/…: commands of people, the fate of notifications, and our own outbox after a crash.

    cnctwin/alerts/command/ack        {"id", "by", "fingerprint", "comment"}
    cnctwin/alerts/command/silence    {"id", "by", "matchers": {label: pattern}, "for_s", "starts_s", "comment"}
    cnctwin/alerts/command/unsilence  {"id", "by", "silence"}
    cnctwin/alerts/command/test       {"id", "by", "receiver"}

`id` is any text of the sender's, by which it finds the outcome in cnctwin/alerts/state; a command with an id that was seen is not
done again. What cannot be read is counted and shown, and changes nothing.
"""

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from hashlib import sha256
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from processors.alerts.body import ALERTS_A_BODY_MAX, Notice, iso, item
from processors.alerts.config import AlertsConfig
from processors.alerts.recall import recalled
from processors.alerts.state import (
    FAILURES_MAX,
    OUTCOMES_MAX,
    SETTLED_MAX,
    SILENCES_MAX,
    Alert,
    AlertsState,
    CommandOutcome,
    Failure,
    Item,
    Phase,
    ReceiverState,
    Settled,
    Severity,
    Silence,
    fingerprint,
)
from twin.vocabulary import topics

TOPIC = topics.ALERTS
COMMAND, DELIVERY, OUTBOX = topics.ALERT_COMMAND, topics.ALERT_DELIVERY, topics.ALERT_OUTBOX
MESSAGE_BYTES_MAX = 4096
OUTBOX_BYTES_MAX = 200_000
SILENCE_S_MAX = 30 * 86_400.0
TEST_EXPIRES_S = 600.0
DELIVERED, FAILED = "delivered", "failed"

Name = Annotated[str, Field(min_length=1, max_length=64)]
Comment = Annotated[str, Field(max_length=500)]


class _Message(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False, strict=True)


class Command(_Message):
    """What every command has."""

    id: Name
    by: Name
    comment: Comment = ""


class Ack(Command):
    """Somebody takes care of an alert. `episode` 0: whichever fires now."""

    fingerprint: Name
    episode: int = 0


class SilenceCommand(Command):
    """No notifications of what matches, for a while from `starts_s` (UTC; 0 = now) on."""

    matchers: dict[Name, Name] = Field(min_length=1, max_length=10)
    for_s: float = Field(gt=0.0, le=SILENCE_S_MAX)
    starts_s: float = Field(default=0.0, ge=0.0, le=1e11)


class Unsilence(Command):
    """A silence ends now."""

    silence: Name


class Trial(Command):
    """A notification that says that it is a test."""

    receiver: Name


class Delivery(_Message):
    """What became of a notification."""

    id: Name
    receiver: Name
    outcome: Literal["delivered", "failed"]
    reason: Comment = ""


class OutboxAlert(_Message):
    """What is read of an alert in our own outbox."""

    fingerprint: Name
    labels: dict[str, str]
    annotations: dict[str, str] = {}
    ended: str = Field(alias="endsAt")


class OutboxBody(_Message):
    """The alerts of a notification in our own outbox."""

    alerts: list[OutboxAlert] = Field(default=[], max_length=ALERTS_A_BODY_MAX)


class OutboxItem(_Message):
    """What is read of our own outbox."""

    id: Name
    receiver: Name
    kind: Name
    created: str = ""
    body: OutboxBody = OutboxBody()
    says: list[Annotated[str, Field(max_length=200)]] = Field(max_length=5000)


def taken(config: AlertsConfig, state: AlertsState, topic: str, text: str) -> AlertsState:
    """The state after a message."""
    size_max = OUTBOX_BYTES_MAX if topic.startswith(OUTBOX) else MESSAGE_BYTES_MAX
    try:
        if len(text) > size_max:
            raise ValueError(f"more than {size_max} characters")
        document = json.loads(text)
        if topic.startswith(COMMAND):
            return _command(config, state, topic.removeprefix(COMMAND), document)
        if topic.startswith(DELIVERY):
            return _delivered(state, Delivery.model_validate(document))
        if topic.startswith(OUTBOX):
            return _own(state, OutboxItem.model_validate(document), text)
    except ValidationError as error:
        first = error.errors()[0]
        return _malformed(state, topic, f"{'.'.join(map(str, first['loc']))}: {first['msg']}")
    except (ValueError, RecursionError) as error:
        return _malformed(state, topic, str(error))
    return state


def _malformed(state: AlertsState, topic: str, why: str) -> AlertsState:
    outcome = CommandOutcome("", topic.removeprefix(TOPIC)[:64], "", False, f"cannot be read: {why}"[:200], state.wall_s)
    return replace(_noted(state, outcome), malformed=state.malformed + 1)


def _noted(state: AlertsState, outcome: CommandOutcome) -> AlertsState:
    return replace(state, outcomes=(*state.outcomes, outcome)[-OUTCOMES_MAX:])


# Commands.


def _command(config: AlertsConfig, state: AlertsState, name: str, document: Any) -> AlertsState:
    kind = _COMMANDS.get(name)
    if kind is None:
        raise ValueError(f"no command {name[:32]!r}; there are: {', '.join(_COMMANDS)}")
    model, do = kind
    command: Any = model.model_validate(document)
    if any(outcome.id == command.id for outcome in state.outcomes):
        return state
    state, is_done, text = do(config, state, command)
    return _noted(state, CommandOutcome(command.id, name, command.by, is_done, text, state.wall_s))


Done = tuple[AlertsState, bool, str]


def _ack(_: AlertsConfig, state: AlertsState, command: Ack) -> Done:
    alert = state.alerts.get(command.fingerprint)
    if alert is None or not alert.is_on:
        return state, False, f"no alert {command.fingerprint} fires"
    if command.episode not in (0, alert.episode):
        return state, False, f"{alert.name} on {alert.machine}: that episode is over, another one fires"
    if alert.phase is Phase.ACKNOWLEDGED:
        return state, True, f"{alert.name} on {alert.machine} was acknowledged by {alert.acknowledged_by} before"
    acknowledged = replace(
        alert,
        phase=Phase.ACKNOWLEDGED,
        acknowledged_by=command.by,
        comment=command.comment,
        since_wall_s=state.wall_s,
    )
    alerts = state.alerts | {alert.fingerprint: acknowledged}
    return replace(state, alerts=alerts), True, f"{alert.name} on {alert.machine} is acknowledged"


def _silence(_: AlertsConfig, state: AlertsState, command: SilenceCommand) -> Done:
    if len(state.silences) >= SILENCES_MAX:
        return state, False, f"there are {SILENCES_MAX} silences already; end one with unsilence"
    starts_s = command.starts_s or state.wall_s
    key = sha256(command.id.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    silence = Silence(key, dict(command.matchers), starts_s, starts_s + command.for_s, command.by, command.comment)
    return replace(state, silences=(*state.silences, silence)), True, f"silence {key}"


def _unsilence(_: AlertsConfig, state: AlertsState, command: Unsilence) -> Done:
    left = tuple(silence for silence in state.silences if silence.id != command.silence)
    if len(left) == len(state.silences):
        return state, False, f"there is no silence {command.silence}"
    return replace(state, silences=left), True, f"silence {command.silence} has ended"


def _test(config: AlertsConfig, state: AlertsState, command: Trial) -> Done:
    if command.receiver not in config.receivers:
        return state, False, f"there is no receiver {command.receiver!r}; there are: {', '.join(config.receivers) or 'none'}"
    key = sha256(command.id.encode("utf-8", "surrogatepass")).hexdigest()[:16]
    notes = (f"asked for by {command.by}",)
    notice = Notice(command.receiver, "test", "test", {}, (), (f"test.{key}",), notes, TEST_EXPIRES_S)
    made = item(notice, config, state.wall_s, state.clock_s)
    return replace(state, outbox=state.outbox | {made.id: made}), True, made.id


_COMMANDS: dict[str, tuple[type[Command], Callable[..., Done]]] = {
    "ack": (Ack, _ack),
    "silence": (SilenceCommand, _silence),
    "unsilence": (Unsilence, _unsilence),
    "test": (Trial, _test),
}


# The fate of notifications.


def _delivered(state: AlertsState, delivery: Delivery) -> AlertsState:
    return settled(state, delivery.id, delivery.receiver, delivery.outcome, delivery.reason)


def settled(state: AlertsState, key: str, receiver: str, outcome: str, reason: str) -> AlertsState:
    """The fate of a notification is known: counted once. A failure is kept to be seen, and escalates what it said."""
    if key in state.settled or len(state.settled) >= SETTLED_MAX:
        return state
    made = state.outbox.get(key)
    known = state.receivers.get(receiver, ReceiverState())
    if outcome == DELIVERED:
        known = replace(known, delivered=known.delivered + 1, last_delivered_wall_s=state.wall_s)
    else:
        known = replace(known, failed=known.failed + 1, last_error=reason)
        says = made.says if made is not None else ()
        failure = Failure(key, receiver, reason, state.wall_s, says)
        told = {said.split(".")[0] for said in says}
        failed = {name: replace(alert, undelivered=True) for name, alert in state.alerts.items() if name in told and alert.is_on}
        state = replace(state, failures=(*state.failures, failure)[-FAILURES_MAX:], alerts=state.alerts | failed)
    outbox = {name: one for name, one in state.outbox.items() if name != key}
    return replace(
        state,
        outbox=outbox,
        settled=state.settled | {key: Settled(receiver, outcome, reason, state.clock_s)},
        receivers=state.receivers | {receiver: known},
    )


def _own(state: AlertsState, found: OutboxItem, text: str) -> AlertsState:
    if found.id in state.outbox:
        return state
    made = Item(
        found.id,
        found.receiver,
        found.kind,
        tuple(found.says),
        text,
        state.clock_s,
        state.clock_s,
        state.clock_s + TEST_EXPIRES_S,
    )
    written = {one.fingerprint: _written(one) for one in found.body.alerts if _is_ours(one)}
    return recalled(state, made, written, is_later=found.created > iso(round(state.wall_s * 1000)))


def _is_ours(found: OutboxAlert) -> bool:
    """Whether its labels are those of its fingerprint."""
    labels = {name: value for name, value in found.labels.items() if name != "severity"}
    return {"machine", "alertname", "severity"} <= found.labels.keys() and fingerprint(labels) == found.fingerprint


def _written(found: OutboxAlert) -> Alert:
    """The alert of no episode yet. Raises ValueError where its severity or its end is none."""
    labels = found.labels
    return Alert(
        labels["machine"],
        labels["alertname"],
        labels.get("signal", ""),
        found.fingerprint,
        Severity(labels["severity"]),
        0,
        ended_ms=round(datetime.fromisoformat(found.ended).replace(tzinfo=UTC).timestamp() * 1000),
        context=found.annotations.get("description", ""),
    )
