"""The times at which a receiver is told: grouping, the interval of a group, repeats, the rate limit, quiet hours.

News waits group_wait_s, so that what happens together is told together. A group that was told is told again after
group_interval_s; a high alert that begins does not wait for that, but for IN_A_ROW_MAX times. Where more than FOLDED_FROM groups
have news at once, all of it is one notification. In quiet hours only high alerts go out; what is still so at
their end goes out as one digest. What the rate limit holds back is told when there is room, as it is then, and the number of
notifications that were held back is said.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from processors.alerts.body import Notice
from processors.alerts.config import AlertsConfig
from processors.alerts.outbox import made
from processors.alerts.receivers import AnyReceiver
from processors.alerts.routing import Change, changes_for, has_passed
from processors.alerts.silence import silenced_by
from processors.alerts.state import OUTBOX_MAX, Alert, AlertsState, Group, LastNotice, ReceiverState, Severity
from processors.alerts.statement import FIRING, OVER, PASSED, RAISED, REPEAT, RESOLVED
from processors.alerts.words.wording import Wording
from processors.alerts.words.wordings import wording_of
from processors.config import Configuration

HOUR_S = 3600.0
EXPIRES_S = 6 * HOUR_S
DIGEST = "digest"
FOLDED = "folded"  # the key of what is told of many groups at once
FOLDED_FROM = 10  # groups
FOLDED_S = 60.0
IN_A_ROW_MAX = 5  # notifications of a group that do not wait for its interval


class _Bundle(NamedTuple):
    """News that goes out together."""

    kind: str
    key: str
    labels: Mapping[str, str]
    news: list[Change]


class _Desk(NamedTuple):
    """The context of deciding for one receiver."""

    name: str
    receiver: AnyReceiver
    config: AlertsConfig
    state: AlertsState
    silenced: Mapping[str, str]
    words: Wording


def notified(configuration: Configuration[AlertsConfig], state: AlertsState) -> AlertsState:
    """The state with every notification that is due in the outbox."""
    config = configuration.default
    configs = {alert.machine: configuration.of(alert.machine) for alert in state.alerts.values()}
    silences = tuple(silence for silence in state.silences if silence.ends_s > state.wall_s)
    state = replace(state, silences=silences)
    silenced = silenced_alerts(state, configs)
    receivers, outbox = {}, dict(state.outbox)
    for name, receiver in config.receivers.items():
        known = _passed_in_silence(_tidied(state.receivers.get(name, ReceiverState()), state), state, silenced)
        changes = changes_for(name, known, state, configs, silenced)
        if not receiver.send_resolved:
            known, changes = _without_resolved(known, changes, state.clock_s)
        desk = _Desk(name, receiver, config, state, silenced, wording_of(configuration, name))
        known, notices = _due(desk, known, changes)
        for notice in notices:
            if len(outbox) < OUTBOX_MAX:
                item = made(notice, configuration, state.wall_s, state.clock_s)
                if item.id not in state.settled and item.id not in outbox:
                    outbox[item.id] = item
        receivers[name] = known
    return replace(state, receivers=receivers, outbox=outbox)


def silenced_alerts(state: AlertsState, configs: Mapping[str, AlertsConfig]) -> dict[str, str]:
    """The alerts that a silence holds for, and which."""
    if not state.silences:
        return {}
    found = {key: silenced_by(state.silences, a, configs[a.machine], state.wall_s) for key, a in state.alerts.items()}
    return {key: silence for key, silence in found.items() if silence}


def _tidied(known: ReceiverState, state: AlertsState) -> ReceiverState:
    """Without what is over: alerts that are forgotten, notifications of more than an hour ago."""
    after_s = state.clock_s - HOUR_S
    return replace(
        known,
        told={key: told for key, told in known.told.items() if key in state.alerts},
        recent_s=tuple(at_s for at_s in known.recent_s if at_s > after_s),
        recent_high_s=tuple(at_s for at_s in known.recent_high_s if at_s > after_s),
    )


def _passed_in_silence(known: ReceiverState, state: AlertsState, silenced: Mapping[str, str]) -> ReceiverState:
    """Mark alerts that came and went while silenced as known: they are not told afterwards."""
    alerts = [state.alerts[key] for key in silenced]
    over = [alert for alert in alerts if has_passed(alert, known.told.get(alert.fingerprint), state.clock_s)]
    firing = [alert for alert in over if (told := known.told.get(alert.fingerprint)) is not None and told.is_firing]
    return _told(known, [Change(alert, PASSED, 0) for alert in over if alert not in firing], state.clock_s)


def _without_resolved(known: ReceiverState, changes: list[Change], clock_s: float) -> tuple[ReceiverState, list[Change]]:
    """Note ends as told to a receiver that wants none of them, so that the next firing is news."""
    ended = [change for change in changes if change.what == RESOLVED]
    return _told(known, ended, clock_s), [change for change in changes if change.what != RESOLVED]


def _due(desk: _Desk, known: ReceiverState, changes: list[Change]) -> tuple[ReceiverState, list[Notice]]:
    """The notices that are due for one receiver, and what it knows then."""
    config, clock_s = desk.config, desk.state.clock_s
    quiet = any(hours.holds(desk.name, desk.state.wall_s) for hours in config.quiet_hours)
    notices: list[Notice] = []
    if quiet:
        loud = [change for change in changes if change.alert.severity is Severity.HIGH]
        muted = [change for change in changes if change not in loud]
        over = [change for change in muted if change.what == PASSED]  # not so any more when the quiet ends
        known = replace(_told(known, over, clock_s), is_muted=known.is_muted or len(over) < len(muted))
        changes = loud
    elif known.is_muted:
        if changes:
            is_held = known.groups.get(DIGEST, Group()).is_held
            known, sent = _send(desk, known, _Bundle(DIGEST, DIGEST, {}, changes), is_held=is_held)
            if sent is None:
                return replace(known, groups=known.groups | {DIGEST: Group(is_held=True)}), []
            notices.append(sent)
        known, changes = replace(known, is_muted=False), []
    groups: dict[str, list[Change]] = {}
    for change in changes:
        groups.setdefault(_group_key(config, change.alert), []).append(change)
    states = {key: group for key, group in known.groups.items() if key in groups or _is_fresh(group, config, clock_s)}
    for key in states.keys() - groups.keys():
        states[key] = replace(states[key], waiting_s=None, is_held=False)
    if FOLDED in known.groups:
        states[FOLDED] = known.groups[FOLDED]
    ready: dict[str, list[Change]] = {}
    for key, news in groups.items():
        group = states.get(key, Group())
        if group.waiting_s is None:
            group = replace(group, waiting_s=clock_s)
        states[key] = group
        if _is_ready(group, news, config, clock_s):
            ready[key] = news
    if sum(not states[key].is_held for key in ready) > FOLDED_FROM:
        return _folded(desk, replace(known, groups=states), ready)
    for key, news in ready.items():
        bundle = _Bundle("notify", key, _group_labels(config, news[0].alert), news)
        known, sent = _send(desk, known, bundle, is_held=states[key].is_held)
        if sent is None:
            states[key] = replace(states[key], is_held=True)
            continue
        notices.append(sent)
        states[key] = _sent(states[key], config, clock_s)
    return replace(known, groups=states), notices


def _folded(desk: _Desk, known: ReceiverState, ready: Mapping[str, list[Change]]) -> tuple[ReceiverState, list[Notice]]:
    """One notification for many groups that have news at once, at most every FOLDED_S: a flood of alerts of many machines is not
    to use up what may be told of the others. The machines that are known longest come first: a body shows so many and no more."""
    clock_s, folded = desk.state.clock_s, known.groups.get(FOLDED, Group())
    if folded.sent_s is not None and clock_s - folded.sent_s < FOLDED_S:
        return known, []
    known_for = {machine: place for place, machine in enumerate(desk.state.machines)}  # a flood is of newcomers as a rule
    news = sorted(
        (change for of_group in ready.values() for change in of_group),
        key=lambda change: (-change.alert.severity.rank, known_for.get(change.alert.machine, len(known_for))),
    )
    known, sent = _send(desk, known, _Bundle("notify", FOLDED, {}, news), is_held=folded.is_held)
    if sent is None:
        return replace(known, groups=known.groups | {FOLDED: replace(folded, is_held=True)}), []
    told = {key: _sent(known.groups[key], desk.config, clock_s) for key in ready}
    return replace(known, groups=known.groups | told | {FOLDED: Group(sent_s=clock_s)}), [sent]


def _sent(group: Group, config: AlertsConfig, clock_s: float) -> Group:
    """The group once it was told."""
    return Group(sent_s=clock_s, in_a_row=group.in_a_row + 1 if _is_fresh(group, config, clock_s) else 0)


def _is_ready(group: Group, news: list[Change], config: AlertsConfig, clock_s: float) -> bool:
    waited_s = clock_s - (clock_s if group.waiting_s is None else group.waiting_s)
    if waited_s < config.group_wait_s and not all(change.what == REPEAT for change in news):
        return False
    if group.sent_s is None or clock_s - group.sent_s >= config.group_interval_s:
        return True
    if group.in_a_row >= IN_A_ROW_MAX:
        return False
    return any(change.alert.severity is Severity.HIGH and change.what in (FIRING, RAISED) for change in news)


def _is_fresh(group: Group, config: AlertsConfig, clock_s: float) -> bool:
    return group.sent_s is not None and clock_s - group.sent_s < config.group_interval_s


def _send(desk: _Desk, known: ReceiverState, bundle: _Bundle, *, is_held: bool) -> tuple[ReceiverState, Notice | None]:
    """The notice, unless the rate limit holds it back; counted when it begins to."""
    kind, key, labels, news = bundle
    clock_s, receiver = desk.state.clock_s, desk.receiver
    is_high = any(change.alert.severity is Severity.HIGH and change.what not in OVER for change in news)
    used = len(known.recent_high_s if is_high else known.recent_s)
    if used >= (receiver.rate_high_per_hour if is_high else receiver.rate_per_hour) or len(desk.state.outbox) >= OUTBOX_MAX:
        if is_held:
            return known, None
        held, unsaid = known.held_back + 1, known.held_back_unsaid + 1
        return replace(known, held_back=held, held_back_unsaid=unsaid), None
    notes = (desk.words.held_back(known.held_back_unsaid),) if known.held_back_unsaid else ()
    alerts = _alerts_in(desk, known, key, news, kind)
    says = tuple(change.says for change in news)
    notice = Notice(desk.name, kind, f"{{}}/{{receiver={desk.name!r}}}:{{{key}}}", labels, alerts, says, notes, EXPIRES_S)
    if is_high:
        known = replace(known, recent_high_s=(*known.recent_high_s, clock_s))
    else:
        known = replace(known, recent_s=(*known.recent_s, clock_s))
    known = _told(replace(known, held_back_unsaid=0), news, clock_s)
    also = {alert.fingerprint: replace(known.told[alert.fingerprint], at_s=clock_s) for alert in alerts if alert.is_on}
    return replace(known, told=known.told | also), notice


def _alerts_in(desk: _Desk, known: ReceiverState, key: str, news: list[Change], kind: str) -> tuple[Alert, ...]:
    """Return the new alerts, then what else of the group this receiver believes to be firing, so that it sees the whole."""
    new = tuple(change.alert for change in news)
    if kind == DIGEST:
        return new
    named = {alert.fingerprint for alert in new}
    rest = (
        alert
        for fingerprint, alert in desk.state.alerts.items()
        if fingerprint not in named
        and alert.is_on
        and fingerprint not in desk.silenced
        and _group_key(desk.config, alert) == key
        and (told := known.told.get(fingerprint)) is not None
        and told.episode == alert.episode
        and told.is_firing
    )
    return (*new, *rest)


def _told(known: ReceiverState, news: list[Change], clock_s: float) -> ReceiverState:
    told = {
        change.alert.fingerprint: LastNotice(
            change.alert.episode, change.alert.severity, change.what not in OVER, clock_s, change.told_before + 1
        )
        for change in news
    }
    return replace(known, told=known.told | told)


def _group_key(config: AlertsConfig, alert: Alert) -> str:
    return f"machine={alert.machine!r}" if config.group_by == "machine" else ""


def _group_labels(config: AlertsConfig, alert: Alert) -> dict[str, str]:
    return {"machine": alert.machine} if config.group_by == "machine" else {}
