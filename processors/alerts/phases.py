"""The life of one alert: pending, firing, acknowledged, resolved; and what it is judged by.

    none -> pending -> firing -> acknowledged -> resolved
              |           \\________________________/
              +-> none, where the alarm went before for_s

An alarm that cannot be read keeps the phase and stops both dwells. One that flaps is kept firing for longer.
"""

from dataclasses import replace
from typing import NamedTuple

from processors.alerts.config import AlertsConfig, Rule
from processors.alerts.state import Alert, Phase, Severity
from processors.sample import why_unknown
from sparkplug.metric import Reading

RISES_MAX = 50
NOT_OFFERED = "not offered"


class Condition(NamedTuple):
    """The alarm as it stands: yes, no, or None with the reason; since when in event time (ms)."""

    stands: bool | None
    reason: str
    at_ms: int


class Flapping(NamedTuple):
    """An alert that comes and goes.

    times, within_s: how often it has fired within how long
    away_s: how long its alarm has been gone by now; None while it stands
    stays_away_s: how long it has to be gone to be over
    """

    times: int
    within_s: float
    away_s: float | None
    stays_away_s: float

    def in_steps(self) -> "Flapping":
        """Return it with durations that change once a minute at most, and every ten seconds within the first one.

        >>> Flapping(4, 367.0, 24.0, 7200.0).in_steps()
        Flapping(times=4, within_s=360.0, away_s=20.0, stays_away_s=7200.0)
        """
        away_s = None if self.away_s is None else _stepped(self.away_s)
        return self._replace(within_s=_stepped(self.within_s), away_s=away_s)


class Beat(NamedTuple):
    """The present: UTC, the clock that never goes back, and how much of it was watched since the last beat."""

    wall_s: float
    clock_s: float
    seen_s: float


def condition_of(reading: Reading | None) -> Condition:
    """Return the condition that an alarm signal reports."""
    if reading is None:
        return Condition(None, NOT_OFFERED, 0)
    if (reason := why_unknown(reading)) is not None:
        return Condition(None, reason, reading.timestamp_ms)
    if not isinstance(reading.value, bool):
        return Condition(None, f"{reading.name} is neither true nor false", reading.timestamp_ms)
    return Condition(reading.value, "", reading.timestamp_ms)


def begun(fresh: Alert, rule: Rule, condition: Condition, beat: Beat) -> Alert:
    """An alert whose alarm has just come up; `fresh` carries what it is and what is remembered of earlier episodes."""
    episode = max(condition.at_ms, fresh.episode + 1) if fresh.rises_s else condition.at_ms
    pending = replace(
        fresh,
        phase=Phase.PENDING,
        episode=episode,
        since_wall_s=beat.wall_s,
        held_s=0.0,
        clear_s=None,
        unknown="",
        unknown_s=0.0,
        ended_ms=0,
        earlier=(fresh.episode, fresh.ended_ms),
        severity=rule.severity,
        severities=(),
        acknowledged_by="",
        comment="",
        undelivered=False,
    )
    return pending if rule.for_s > 0.0 else _fired(pending, beat)


def advanced(alert: Alert, rule: Rule, condition: Condition, beat: Beat, config: AlertsConfig) -> Alert | None:
    """The alert one beat later; None where nothing of it is left."""
    if alert.phase is Phase.RESOLVED:
        return begun(alert, rule, condition, beat) if condition.stands else alert
    if condition.stands is None:
        unknown_s = alert.unknown_s + beat.seen_s
        if unknown_s > config.forget_after_s:
            return _ended(alert, beat, round(beat.wall_s * 1000))
        return replace(alert, unknown=condition.reason, unknown_s=unknown_s)
    if alert.unknown or alert.unknown_s:
        alert = replace(alert, unknown="", unknown_s=0.0)
    if alert.phase is Phase.PENDING:
        if not condition.stands:
            return _gone(alert)
        held_s = alert.held_s + beat.seen_s
        return _fired(alert, beat) if held_s >= rule.for_s else replace(alert, held_s=held_s)
    if condition.stands:
        if alert.clear_s is None:
            return alert
        is_rise = alert.clear_s >= rule.keep_firing_for_s
        rises_s = (*alert.rises_s, beat.clock_s)[-RISES_MAX:] if is_rise else alert.rises_s
        return replace(alert, clear_s=None, rises_s=rises_s)
    clear_s = 0.0 if alert.clear_s is None else alert.clear_s + beat.seen_s
    if clear_s >= keep_firing_for_s(alert, rule, beat.clock_s, config):
        return _ended(alert, beat, condition.at_ms if alert.clear_s is None else alert.clear_ms)
    return replace(alert, clear_s=clear_s, clear_ms=condition.at_ms if alert.clear_s is None else alert.clear_ms)


def raised(alert: Alert, severity: Severity, beat: Beat) -> Alert:
    """The alert at a severity that only rises within an episode. An acknowledgement was for the lesser one."""
    if not alert.is_on or severity.rank <= alert.severity.rank:
        return alert
    worse = replace(alert, severity=severity, severities=(*alert.severities, severity))
    if worse.phase is Phase.ACKNOWLEDGED:
        return replace(worse, phase=Phase.FIRING, since_wall_s=beat.wall_s, acknowledged_by="", comment="")
    return worse


def caught_up(alert: Alert, severity: Severity, episode: int, ended_ms: int | None, beat: Beat) -> Alert:
    """The alert as far as an earlier life of ours took it: it told that this episode fires, or that it was over at `ended_ms`.

    An alert that is further already stays as it is.
    """
    if alert.episode > episode or (alert.episode == episode and alert.phase is Phase.RESOLVED):
        return alert
    if alert.episode < episode:
        alert = begun(alert, Rule(severity=severity), Condition(True, "", episode), beat)
    elif alert.phase is Phase.PENDING:
        alert = _fired(alert, beat)
    alert = raised(alert, severity, beat)
    return alert if ended_ms is None else _over(alert, beat, ended_ms)


def flapping_of(alert: Alert, clock_s: float, config: AlertsConfig) -> Flapping | None:
    """Return how it comes and goes, where it has fired so often lately, or would have but for being kept firing, that each
    firing is no news."""
    rises_s = [rise_s for rise_s in alert.rises_s if clock_s - rise_s <= config.flap_window_s]
    if len(rises_s) < config.flap_episodes:
        return None
    return Flapping(len(rises_s), clock_s - rises_s[0], alert.clear_s, config.flap_keep_firing_for_s)


def keep_firing_for_s(alert: Alert, rule: Rule, clock_s: float, config: AlertsConfig) -> float:
    """Return how long the alarm has to be gone."""
    if flapping_of(alert, clock_s, config) is not None:
        return max(rule.keep_firing_for_s, config.flap_keep_firing_for_s)
    return rule.keep_firing_for_s


def _stepped(seconds: float) -> float:
    return seconds // 60.0 * 60.0 if seconds >= 60.0 else seconds // 10.0 * 10.0


def _fired(alert: Alert, beat: Beat) -> Alert:
    return replace(
        alert,
        phase=Phase.FIRING,
        since_wall_s=beat.wall_s,
        fired_s=beat.clock_s,
        rises_s=(*alert.rises_s, beat.clock_s)[-RISES_MAX:],
        severities=(alert.severity,),
    )


def _gone(alert: Alert) -> Alert | None:
    """An alert that pended and did not fire: what is left is the episode before, if there was one."""
    if not alert.rises_s:
        return None
    episode, ended_ms = alert.earlier
    return replace(alert, phase=Phase.RESOLVED, episode=episode, ended_ms=ended_ms, unknown="", unknown_s=0.0)


def _ended(alert: Alert, beat: Beat, at_ms: int) -> Alert | None:
    return _over(alert, beat, at_ms) if alert.is_on else _gone(alert)


def _over(alert: Alert, beat: Beat, at_ms: int) -> Alert:
    return replace(
        alert,
        phase=Phase.RESOLVED,
        since_wall_s=beat.wall_s,
        ended_ms=max(at_ms, alert.episode),
        resolved_s=beat.clock_s,
        clear_s=None,
        unknown="",
        unknown_s=0.0,
    )
