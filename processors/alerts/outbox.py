"""The outbox: from a notice that is due to a notification whose fate is known, and back again after a crash.

    made     the notice gets an id, the same for the same news, and is written
    emitted  it is published, retained, and again while its fate is not known; once settled it is removed a while later
    settled  the courier has delivered it, or says why not
    recalled after a crash, an earlier life's notifications are read from the broker

After a crash the state is that of the last snapshot, up to a few seconds old. What was told since then stays so: an alert that
was told as firing fires, so that its end is told too, and an episode whose end was told is over, so that an alarm that stands
again is an episode of its own.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from hashlib import sha256

from processors.alerts.body import FACTS_TOLD, Notice, iso
from processors.alerts.facts import Facts
from processors.alerts.notification import Notification, WrittenAlert, written
from processors.alerts.phases import Beat, caught_up
from processors.alerts.state import (
    ALERTS_MAX,
    FAILURES_MAX,
    OUTBOX_MAX,
    SETTLED_MAX,
    Alert,
    AlertsState,
    Failure,
    Item,
    LastNotice,
    ReceiverState,
    Settled,
    Severity,
    fingerprint,
)
from processors.alerts.statement import OVER, statements_in
from processors.alerts.words.wordings import Alerts
from processors.contract import PlainOutput
from twin.vocabulary import topics

OUTBOX, DELIVERY = topics.ALERT_OUTBOX, topics.ALERT_DELIVERY
DELIVERED, FAILED = "delivered", "failed"
NOT_YET_S = -1e9  # of an item that was not emitted yet
EMIT_AGAIN_S = 30.0  # an outbox item of unknown fate: the message may have been lost
CLEAR_AFTER_S = 60.0  # a settled item: long after the snapshot that knows of it
RECALLED_EXPIRES_S = 600.0
Shown = Mapping[tuple[str, int], Alert]
"""The alerts of a notification by fingerprint and episode."""


def notification_id(receiver: str, kind: str, says: Iterable[str]) -> str:
    """Return the id of a notification: the same for the same news to the same receiver, also after a crash."""
    text = "\n".join((receiver, kind, *sorted(says)))
    return sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:16]


def made(notice: Notice, configuration: Alerts, wall_s: float, clock_s: float) -> Item:
    """The notification as it stands in the outbox."""
    key = notification_id(notice.receiver, notice.kind, notice.says)
    payload = written(key, notice, configuration, wall_s, clock_s)
    return Item(key, notice.receiver, notice.kind, notice.says, payload, clock_s, NOT_YET_S, clock_s + notice.expires_s)


def emitted(state: AlertsState) -> tuple[AlertsState, list[PlainOutput]]:
    """New notifications, those of unknown fate again, and the removal of what is settled."""
    clock_s = state.clock_s
    for key, item in state.outbox.items():
        if clock_s > item.expires_s + CLEAR_AFTER_S:
            state = settled(state, key, item.receiver, FAILED, "what became of it was not reported; it may have arrived")
    outputs = []
    outbox: dict[str, Item] = {}
    for key, item in state.outbox.items():
        is_due = clock_s - item.emitted_s >= EMIT_AGAIN_S
        outbox[key] = replace(item, emitted_s=clock_s) if is_due else item
        if is_due:
            outputs.append(PlainOutput(f"{OUTBOX}{key}", item.payload.encode("utf-8", "replace")))
    kept = dict(state.settled)
    for key, fate in state.settled.items():
        if clock_s - fate.at_s >= CLEAR_AFTER_S:
            outputs += [PlainOutput(f"{OUTBOX}{key}", b""), PlainOutput(f"{DELIVERY}{key}", b"")]
            del kept[key]
    return replace(state, outbox=outbox, settled=kept), outputs


def settled(state: AlertsState, key: str, receiver: str, outcome: str, reason: str) -> AlertsState:
    """The fate of a notification is known: counted once. A failure is kept to be seen, and escalates what it said."""
    if key in state.settled or len(state.settled) >= SETTLED_MAX:
        return state
    item = state.outbox.get(key)
    known = replace(state.receivers.get(receiver, ReceiverState()), not_taken="")
    if outcome == DELIVERED:
        known = replace(known, delivered=known.delivered + 1, last_delivered_wall_s=state.wall_s)
    else:
        known = replace(known, failed=known.failed + 1, last_error=reason)
        says = item.says if item is not None else ()
        failure = Failure(key, receiver, reason, state.wall_s, says)
        told = {statement.fingerprint for statement in statements_in(says)}
        failed = {name: replace(alert, undelivered=True) for name, alert in state.alerts.items() if name in told and alert.is_on}
        state = replace(state, failures=(*state.failures, failure)[-FAILURES_MAX:], alerts=state.alerts | failed)
    outbox = {name: one for name, one in state.outbox.items() if name != key}
    return replace(
        state,
        outbox=outbox,
        settled=state.settled | {key: Settled(receiver, outcome, reason, state.clock_s)},
        receivers=state.receivers | {receiver: known},
    )


def postponed(state: AlertsState, key: str, receiver: str, reason: str) -> AlertsState:
    """The receiver surely has not taken a notification, for this reason; it is tried again."""
    item = state.outbox.get(key)
    if item is None or item.receiver != receiver:
        return state
    known = replace(state.receivers.get(receiver, ReceiverState()), not_taken=reason)
    return replace(state, receivers=state.receivers | {receiver: known})


def recalled(state: AlertsState, found: Notification, payload: str) -> AlertsState:
    """The state that knows of a notification of ours, read as `payload`. Raises ValueError where an alert in it is none.

    Where it was made later than the state, the alerts are at least as far as it says; an older one says only what was told.
    """
    if found.id in state.outbox:
        return state
    shown = {(one.fingerprint, one.episode): _alert(one) for one in found.alerts if _is_ours(one)}
    is_later = found.created > iso(round(state.wall_s * 1000))
    known = state.receivers.get(found.receiver, ReceiverState())
    state = _caught_up(state, found, known, shown if is_later else {})
    if found.id in state.settled or len(state.outbox) >= OUTBOX_MAX:
        return state
    now_s = state.clock_s
    item = Item(found.id, found.receiver, found.kind, found.says, payload, now_s, now_s, now_s + RECALLED_EXPIRES_S)
    return replace(state, outbox=state.outbox | {item.id: item})


def _caught_up(state: AlertsState, found: Notification, known: ReceiverState, shown: Shown) -> AlertsState:
    """The receiver knows what it was told; the alerts that are `shown`, of no episode yet, are as far as that."""
    told, alerts = dict(known.told), dict(state.alerts)
    beat = Beat(state.wall_s, state.clock_s, 0.0)
    for said in found.statements:
        before, count = told.get(said.fingerprint), said.told_before + 1
        if before is not None and (before.episode, before.count) >= (said.episode, count):
            continue
        is_over = said.what in OVER
        told[said.fingerprint] = LastNotice(said.episode, said.severity, not is_over, state.clock_s, count)
        written_alert = shown.get((said.fingerprint, said.episode))
        alert = alerts.get(said.fingerprint, written_alert)
        if written_alert is None or alert is None or (alert is written_alert and len(alerts) >= ALERTS_MAX):
            continue
        ended_ms = written_alert.ended_ms if is_over else None
        alerts[said.fingerprint] = caught_up(alert, said.severity, said.episode, ended_ms, beat)
    return replace(state, receivers=state.receivers | {found.receiver: replace(known, told=told)}, alerts=alerts)


def _is_ours(one: WrittenAlert) -> bool:
    """Return True if its labels are those of its fingerprint."""
    labels = {name: value for name, value in one.labels.items() if name != "severity"}
    return {"machine", "alertname", "severity"} <= one.labels.keys() and fingerprint(labels) == one.fingerprint


def _alert(one: WrittenAlert) -> Alert:
    """The alert of no episode yet. Raises ValueError where its severity or its end is none."""
    labels, lasted_ms = one.labels, one.episode - _ms(one.started)
    facts: Facts = {name: fact for name in FACTS_TOLD if (fact := one.annotations.get(name))}
    if lasted_ms > 0:
        facts["lasted_s"] = lasted_ms / 1000.0
    return Alert(
        labels["machine"],
        labels["alertname"],
        labels.get("signal", ""),
        one.fingerprint,
        Severity(labels["severity"]),
        0,
        ended_ms=_ms(one.ended),
        facts=facts,
    )


def _ms(moment: str) -> int:
    """Return a moment in ms since 1970. Raises ValueError where it is none."""
    return round(datetime.fromisoformat(moment).replace(tzinfo=UTC).timestamp() * 1000)
