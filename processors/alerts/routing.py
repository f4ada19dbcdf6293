"""Routing: the receivers that an alert goes to, and what is news to each of them."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

from processors.alerts.config import AlertsConfig, Route
from processors.alerts.state import Alert, AlertsState, LastNotice, Phase, ReceiverState
from processors.alerts.statement import FIRING, PASSED, RAISED, REPEAT, RESOLVED, Statement

PASSED_S_MAX = 3600.0


class Change(NamedTuple):
    """An alert that a receiver has to be told of, what is new, and how often it was told of this episode before."""

    alert: Alert
    what: str
    told_before: int

    @property
    def says(self) -> str:
        """The line of the notification."""
        alert = self.alert
        return Statement(alert.fingerprint, alert.episode, self.what, self.told_before, alert.severity).text


def receivers_of(alert: Alert, config: AlertsConfig, clock_s: float, told_by: Iterable[str]) -> set[str]:
    """Return who is to know of this alert now. Without any route every receiver is, but one that is there for the heartbeat.

    An escalation goes out when nobody has acknowledged in time, or a notification has failed; who was told in this episode, by a
    route or an escalation, is told of its end too.
    """
    if not config.routes:
        return set(config.receivers) - {config.heartbeat.receiver} or set(config.receivers)
    names: set[str] = set(told_by)
    for route in config.routes:
        if not _matches(route, alert):
            continue
        names.update(route.receivers)
        if alert.phase is Phase.FIRING:
            waited_s = clock_s - alert.fired_s
            names.update(step.receiver for step in route.escalation if alert.undelivered or waited_s >= step.after_s)
    return names


def _matches(route: Route, alert: Alert) -> bool:
    named = (not route.machines or alert.machine in route.machines) and (not route.alerts or alert.name in route.alerts)
    return named and alert.severity.rank >= route.severity_min.rank


def news_of(alert: Alert, told: LastNotice | None, config: AlertsConfig, clock_s: float) -> list[Change]:
    """Return what is news to a receiver that was last told `told`: of an alert that fires again while the receiver believes that
    an earlier episode fires, the end of that one comes first."""
    change = change_of(alert, told, config, clock_s)
    if change is None:
        return []
    if change.what != FIRING or told is None or not told.is_firing or told.episode == alert.episode:
        return [change]
    return [Change(_over(alert, told), RESOLVED, told.count), change]


def _over(alert: Alert, told: LastNotice) -> Alert:
    """Return the earlier episode that a receiver was told of. Where another one lay between, it was over when that one began."""
    began_ms, ended_ms = alert.earlier
    if began_ms != told.episode:
        ended_ms = began_ms
    return replace(
        alert, phase=Phase.RESOLVED, episode=told.episode, ended_ms=max(ended_ms, told.episode), severity=told.severity, facts={}
    )


def change_of(alert: Alert, told: LastNotice | None, config: AlertsConfig, clock_s: float) -> Change | None:
    """Return the newest of what is news to a receiver that was last told `told`."""
    if not alert.is_on:
        # One that pends again is waited for: it fires, or is over after all.
        if told is not None and told.is_firing:
            return Change(alert, RESOLVED, told.count) if alert.phase is Phase.RESOLVED else None
        return Change(alert, PASSED, 0) if has_passed(alert, told, clock_s) else None
    same = told is not None and told.episode == alert.episode
    if told is None or not same or not told.is_firing:
        if alert.phase is Phase.ACKNOWLEDGED:
            return None  # somebody is on it already
        return Change(alert, FIRING, told.count if told is not None and same else 0)
    if alert.severity.rank > told.severity.rank:
        return Change(alert, RAISED, told.count)
    if alert.phase is Phase.FIRING and clock_s - told.at_s >= config.repeat_interval_s:
        return Change(alert, REPEAT, told.count)
    return None


def has_passed(alert: Alert, told: LastNotice | None, clock_s: float) -> bool:
    """Return True if an episode that a receiver knows nothing of is over, and not long ago."""
    if alert.phase is not Phase.RESOLVED or not alert.rises_s or (told is not None and told.episode >= alert.episode):
        return False
    return clock_s - alert.resolved_s <= PASSED_S_MAX


def changes_for(
    receiver: str, known: ReceiverState, state: AlertsState, configs: Mapping[str, AlertsConfig], silenced: Mapping[str, str]
) -> list[Change]:
    """All news for one receiver, the worst first."""
    changes: list[list[Change]] = []
    for key, alert in state.alerts.items():
        if key in silenced:
            continue
        config, told = configs[alert.machine], known.told.get(key)
        told_by = (receiver,) if told is not None and told.is_firing else ()
        if receiver not in receivers_of(alert, config, state.clock_s, told_by):
            continue
        if news := news_of(alert, told, config, state.clock_s):
            changes.append(news)
    changes.sort(key=lambda news: (-news[-1].alert.severity.rank, news[-1].alert.machine, news[-1].alert.name))
    return [change for news in changes for change in news]
