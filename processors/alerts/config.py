"""Configuration of alerts: which signals, how long, who is told, how often. All durations are wall clock."""

import re
from collections.abc import Mapping
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from processors.alarms import alarm_signals, unknown_processors
from processors.alerts.quiet import QuietHours
from processors.alerts.receivers import AnyReceiver, Escalation, Heartbeat
from processors.alerts.state import Severity
from processors.alerts.words.language import ENGLISH
from processors.config import CellConfig
from processors.lag_report import BEHIND_S
from processors.wall_clock import TimeZoneName
from twin.vocabulary import twin_signals

RULES = twin_signals.RULES
SCORE = twin_signals.ANOMALY_ALARM
GAP, DRIFT = twin_signals.GAP_GROWING, twin_signals.SCORE_DRIFT
MACHINE_OFFLINE, SOURCE_LOST, PROCESSORS_BEHIND = "machine_offline", "alarm_source_lost", "processors_behind"
RECEIVERS_MAX = 20
ROUTES_MAX = 100
_NAME = re.compile(r"[A-Za-z0-9_-]{1,32}")
_LABEL = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,63}")
_OWN_LABELS = frozenset({"alertname", "machine", "signal", "severity"})


class Rule(BaseModel):
    """One kind of alert.

    for_s: the alarm has to stand so long before the alert fires
    keep_firing_for_s: it has to be gone so long before the alert is resolved
    raised_by_rule: high where a rule fires on the same machine
    raised_by_control: high where the control gives its own alarm a high severity
    enabled: False = it is no alert
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    severity: Severity
    for_s: float = Field(default=0.0, ge=0.0, le=86_400.0)
    keep_firing_for_s: float = Field(default=60.0, ge=0.0, le=86_400.0)
    raised_by_rule: bool = False
    raised_by_control: bool = False
    enabled: bool = True


class LagRule(Rule):
    """The rule of processors that fall behind.

    behind_s: the alarm begins where a process is so late
    caught_up_s: it is gone where all are less late than this
    """

    behind_s: float = Field(default=BEHIND_S, ge=1.0, le=86_400.0)
    caught_up_s: float = Field(default=2.0, ge=1.0, le=86_400.0)

    @model_validator(mode="after")
    def _ends_below_where_it_begins(self) -> Self:
        if self.caught_up_s > self.behind_s:
            raise ValueError(f"caught_up_s {self.caught_up_s:g} has to be at most behind_s {self.behind_s:g}")
        return self


NAMED = {
    **dict.fromkeys(RULES, Rule(severity=Severity.HIGH)),
    SCORE: Rule(severity=Severity.MEDIUM, raised_by_rule=True),
    GAP: Rule(severity=Severity.MEDIUM),
    DRIFT: Rule(severity=Severity.LOW),
    twin_signals.CONTROL_ALARM: Rule(severity=Severity.MEDIUM, raised_by_control=True),
}
"""The alarms whose severity is known here."""


def _signals() -> dict[str, Rule]:
    """Every declared alarm; one that is not named here is of medium severity."""
    return NAMED | {name: Rule(severity=Severity.MEDIUM) for name in alarm_signals() if name not in NAMED}


class Route(BaseModel):
    """A route of alerts to receivers; what is left empty matches all. An alert goes to the receivers of every route that
    matches it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    receivers: tuple[str, ...]
    machines: tuple[str, ...] = ()
    alerts: tuple[str, ...] = ()
    severity_min: Severity = Severity.LOW
    escalation: tuple[Escalation, ...] = ()


class AlertsConfig(CellConfig):
    """See the sample file, which says what each field does."""

    model_config = ConfigDict(hide_input_in_errors=True)
    unshown = frozenset({"receivers", "heartbeat"})

    signals: dict[str, Rule] = Field(default_factory=_signals)
    machine_offline: Rule | None = Rule(severity=Severity.MEDIUM, for_s=60.0)
    alarm_source_lost: Rule | None = Rule(severity=Severity.MEDIUM, for_s=120.0)
    processors_behind: LagRule | None = LagRule(severity=Severity.MEDIUM, for_s=30.0)
    labels: dict[str, str] = Field(default_factory=dict)
    group_by: Literal["machine", "all"] = "machine"
    group_wait_s: float = Field(default=10.0, ge=0.0, le=3600.0)
    group_interval_s: float = Field(default=300.0, ge=0.0, le=86_400.0)
    repeat_interval_s: float = Field(default=14_400.0, ge=60.0, le=30 * 86_400.0)
    flap_episodes: int = Field(default=4, ge=2, le=50)
    flap_window_s: float = Field(default=21_600.0, ge=60.0, le=7 * 86_400.0)
    flap_keep_firing_for_s: float = Field(default=7200.0, ge=0.0, le=7 * 86_400.0)
    forget_after_s: float = Field(default=604_800.0, ge=3600.0, le=365 * 86_400.0)
    external_url: str = Field(default="", max_length=200)
    language: str = Field(default=ENGLISH, min_length=1, max_length=300)
    time_zone: TimeZoneName = "UTC"
    receivers: dict[str, AnyReceiver] = Field(default_factory=dict, max_length=RECEIVERS_MAX)
    routes: tuple[Route, ...] = Field(default=(), max_length=ROUTES_MAX)
    quiet_hours: tuple[QuietHours, ...] = Field(default=(), max_length=ROUTES_MAX)
    heartbeat: Heartbeat = Heartbeat()

    @field_validator("signals", mode="before")
    @classmethod
    def _stand_over_the_defaults(cls, given: Any) -> Any:
        """Return the rules of all alarms; of one that is given, its values over those that it has by default."""
        if not isinstance(given, Mapping):
            return given
        known = _signals()
        own = {
            name: {**known[name].model_dump(), **rule} if name in known and isinstance(rule, Mapping) else rule
            for name, rule in given.items()
        }
        return {**known, **own}

    @model_validator(mode="after")
    def _names_are_known(self) -> Self:
        if self.cells:
            raise ValueError("cells: alerts watch all machines together; leave it out")
        known = _signals()
        for signal in self.signals:
            if signal not in known and not unknown_processors():  # else it may be an alarm of one of these
                raise ValueError(f"signals: {signal!r} is no alarm signal; there are: {', '.join(known)}")
        for name in self.labels:
            if not _LABEL.fullmatch(name) or name in _OWN_LABELS:
                raise ValueError(
                    f"labels: {name!r} has to be letters, digits and _, and none of {', '.join(sorted(_OWN_LABELS))}"
                )
        for name in self.receivers:
            if not _NAME.fullmatch(name):
                raise ValueError(f"receivers: {name!r} has to be 1 to 32 letters, digits, - and _")
        named = [(f"routes[{n}]", name) for n, route in enumerate(self.routes) for name in _receivers_of(route)]
        named += [(f"quiet_hours[{n}]", name) for n, quiet in enumerate(self.quiet_hours) for name in quiet.receivers]
        named += [("heartbeat", self.heartbeat.receiver)] if self.heartbeat.receiver else []
        for where, name in named:
            if name not in self.receivers:
                raise ValueError(f"{where}: there is no receiver {name!r}; there are: {', '.join(self.receivers) or 'none'}")
        beats_to = self.receivers.get(self.heartbeat.receiver)
        if beats_to is not None and beats_to.type == "pushover":
            raise ValueError("heartbeat: a person should not be notified every few minutes that all is well; use a webhook")
        return self

    def rule_of(self, name: str, signal: str) -> Rule | None:
        """The rule of an alert; None where it is not watched (any more)."""
        rules = {
            MACHINE_OFFLINE: self.machine_offline,
            SOURCE_LOST: self.alarm_source_lost,
            PROCESSORS_BEHIND: self.processors_behind,
        }
        rule = self.signals.get(signal) if signal else rules.get(name)
        return rule if rule is not None and rule.enabled else None


def _receivers_of(route: Route) -> tuple[str, ...]:
    return (*route.receivers, *(step.receiver for step in route.escalation))
