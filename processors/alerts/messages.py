"""Messages on cnctwin/alerts/…: commands of people, the fate of notifications, and our own outbox after a crash.

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
from hashlib import sha256
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from processors.alerts.body import TEST, Notice
from processors.alerts.notification import Name, Notification
from processors.alerts.outbox import made, postponed, recalled, settled
from processors.alerts.state import (
    OUTCOMES_MAX,
    SILENCES_MAX,
    AlertsState,
    CommandOutcome,
    Phase,
    Silence,
)
from processors.alerts.words.wordings import Alerts, wording_of
from twin.vocabulary import topics

TOPIC = topics.ALERTS
COMMAND, DELIVERY, OUTBOX, CLAIM = topics.ALERT_COMMAND, topics.ALERT_DELIVERY, topics.ALERT_OUTBOX, topics.ALERT_CLAIM
MESSAGE_BYTES_MAX = 4096
OUTBOX_BYTES_MAX = 200_000
SILENCE_S_MAX = 30 * 86_400.0
TEST_EXPIRES_S = 600.0

Comment = Annotated[str, Field(max_length=500)]


class _Message(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False, strict=True)


class Command(_Message):
    """The fields that every command has."""

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
    """The fate of a notification."""

    id: Name
    receiver: Name
    outcome: Literal["delivered", "failed"]
    reason: Comment = ""


class Claim(_Message):
    """A sender's claim on a notification; with a reason, the receiver has surely not taken it and it is tried again."""

    id: Name
    receiver: Name = "?"
    reason: Comment = ""


def taken(configuration: Alerts, state: AlertsState, topic: str, text: str) -> AlertsState:
    """The state after a message."""
    size_max = OUTBOX_BYTES_MAX if topic.startswith(OUTBOX) else MESSAGE_BYTES_MAX
    try:
        if len(text) > size_max:
            raise ValueError(f"more than {size_max} characters")
        if topic.startswith(OUTBOX):
            return recalled(state, Notification.of(text), text)
        document = json.loads(text)
        if topic.startswith(COMMAND):
            return _command(configuration, state, topic.removeprefix(COMMAND), document)
        if topic.startswith(CLAIM):
            return _claimed(state, Claim.model_validate(document))
        if topic.startswith(DELIVERY):
            return _delivered(state, Delivery.model_validate(document))
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


def _command(configuration: Alerts, state: AlertsState, name: str, document: Any) -> AlertsState:
    kind = _COMMANDS.get(name)
    if kind is None:
        raise ValueError(f"no command {name[:32]!r}; there are: {', '.join(_COMMANDS)}")
    model, do = kind
    command: Any = model.model_validate(document)
    if any(outcome.id == command.id for outcome in state.outcomes):
        return state
    state, is_done, text = do(configuration, state, command)
    return _noted(state, CommandOutcome(command.id, name, command.by, is_done, text, state.wall_s))


Done = tuple[AlertsState, bool, str]


def _ack(_: Alerts, state: AlertsState, command: Ack) -> Done:
    alert = state.alerts.get(command.fingerprint)
    if alert is None or not alert.is_on:
        return state, False, f"no alert {command.fingerprint} fires"
    if command.episode not in (0, alert.episode):
        return state, False, f"{alert.name} on {alert.machine}: that episode is over, another one fires"
    if alert.phase is Phase.ACKNOWLEDGED:
        return state, True, f"{alert.name} on {alert.machine} is already acknowledged by {alert.acknowledged_by}"
    acknowledged = replace(
        alert,
        phase=Phase.ACKNOWLEDGED,
        acknowledged_by=command.by,
        comment=command.comment,
        since_wall_s=state.wall_s,
    )
    alerts = state.alerts | {alert.fingerprint: acknowledged}
    return replace(state, alerts=alerts), True, f"{alert.name} on {alert.machine} is acknowledged"


def _silence(_: Alerts, state: AlertsState, command: SilenceCommand) -> Done:
    if len(state.silences) >= SILENCES_MAX:
        return state, False, f"there are {SILENCES_MAX} silences already; end one with unsilence"
    starts_s = command.starts_s or state.wall_s
    key = sha256(command.id.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    silence = Silence(key, dict(command.matchers), starts_s, starts_s + command.for_s, command.by, command.comment)
    return replace(state, silences=(*state.silences, silence)), True, f"silence {key}"


def _unsilence(_: Alerts, state: AlertsState, command: Unsilence) -> Done:
    left = tuple(silence for silence in state.silences if silence.id != command.silence)
    if len(left) == len(state.silences):
        return state, False, f"there is no silence {command.silence}"
    return replace(state, silences=left), True, f"silence {command.silence} has ended"


def _test(configuration: Alerts, state: AlertsState, command: Trial) -> Done:
    receivers = configuration.default.receivers
    if command.receiver not in receivers:
        return state, False, f"there is no receiver {command.receiver!r}; there are: {', '.join(receivers) or 'none'}"
    key = sha256(command.id.encode("utf-8", "surrogatepass")).hexdigest()[:16]
    notes = (wording_of(configuration, command.receiver).asked_by(command.by),)
    notice = Notice(command.receiver, TEST, TEST, {}, (), (f"test.{key}",), notes, TEST_EXPIRES_S)
    item = made(notice, configuration, state.wall_s, state.clock_s)
    return replace(state, outbox=state.outbox | {item.id: item}), True, item.id


_COMMANDS: dict[str, tuple[type[Command], Callable[..., Done]]] = {
    "ack": (Ack, _ack),
    "silence": (SilenceCommand, _silence),
    "unsilence": (Unsilence, _unsilence),
    "test": (Trial, _test),
}


# The fate of notifications.


def _claimed(state: AlertsState, claim: Claim) -> AlertsState:
    return postponed(state, claim.id, claim.receiver, claim.reason) if claim.reason else state


def _delivered(state: AlertsState, delivery: Delivery) -> AlertsState:
    return settled(state, delivery.id, delivery.receiver, delivery.outcome, delivery.reason)
