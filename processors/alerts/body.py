"""The content of a notification: the JSON of Alertmanager's webhook, version 4, and a title and a text for people."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from typing import Any

from processors.alerts.config import AlertsConfig
from processors.alerts.state import Alert, Phase, Severity, labels_of

ALERTS_A_BODY_MAX = 50
TEXT_MAX = 2000
TITLE_MAX = 200
NEVER = "0001-01-01T00:00:00Z"  # how Go writes no time, and Alertmanager an alert that has no end yet


@dataclass(frozen=True, slots=True)
class Notice:
    """One notification before it is written: what it is about, what is new in it, what else stands in it."""

    receiver: str
    kind: str  # notify, digest, test, heartbeat
    group: str
    group_labels: Mapping[str, str]
    alerts: tuple[Alert, ...]
    says: tuple[str, ...]
    notes: tuple[str, ...] = ()
    expires_s: float = 0.0


@lru_cache(4096)  # the same few moments are written at every beat
def iso(at_ms: int) -> str:
    """UTC as RFC 3339; no time where no calendar reaches it.

    >>> iso(1668114759262)
    '2022-11-10T21:12:39.262Z'
    """
    try:
        stamp = datetime.fromtimestamp(at_ms / 1000, UTC).isoformat(timespec="milliseconds")
    except (OverflowError, ValueError, OSError):
        return NEVER
    return f"{stamp.removesuffix('+00:00')}Z"


def as_alert(alert: Alert, config: AlertsConfig) -> dict[str, Any]:
    """One alert as Alertmanager writes it."""
    labels = labels_of(alert.machine, alert.name, alert.signal, config.labels) | {"severity": alert.severity.value}
    annotations = {"summary": f"{alert.name} on {alert.machine}"}
    if alert.context:
        annotations["description"] = alert.context
    if alert.unknown:
        annotations["unknown"] = alert.unknown
    if alert.acknowledged_by:
        annotations["acknowledged_by"] = alert.acknowledged_by
    return {
        "status": "firing" if alert.is_on else "resolved",
        "labels": labels,
        "annotations": annotations,
        "startsAt": iso(alert.episode),
        "endsAt": NEVER if alert.is_on else iso(max(alert.ended_ms, alert.episode)),
        "generatorURL": config.external_url,
        "fingerprint": alert.fingerprint,
    }


def body(notice: Notice, config: AlertsConfig) -> dict[str, Any]:
    """The webhook's JSON."""
    shown = [as_alert(alert, config) for alert in notice.alerts[:ALERTS_A_BODY_MAX]]
    return {
        "version": "4",
        "groupKey": notice.group,
        "truncatedAlerts": len(notice.alerts) - len(shown),
        "status": "firing" if any(alert.is_on for alert in notice.alerts) else "resolved",
        "receiver": notice.receiver,
        "groupLabels": dict(notice.group_labels),
        "commonLabels": _common([alert["labels"] for alert in shown]),
        "commonAnnotations": _common([alert["annotations"] for alert in shown]),
        "externalURL": config.external_url,
        "alerts": shown,
    }


def _common(dictionaries: Sequence[Mapping[str, str]]) -> dict[str, str]:
    if not dictionaries:
        return {}
    first, *rest = dictionaries
    return {name: value for name, value in first.items() if all(other.get(name) == value for other in rest)}


def title(notice: Notice) -> str:
    """One line.

    `[2 firing, high] okuma: rule_vibration, anomaly_alarm`
    """
    if notice.kind == "test":
        return "Test of cnctwin's alerts"
    if notice.kind == "heartbeat":
        return "cnctwin is alive"
    on = [alert for alert in notice.alerts if alert.is_on]
    worst = worst_of(on)
    state = f"{len(on)} firing, {worst.value}" if on and worst is not None else "resolved"
    machines = list(dict.fromkeys(alert.machine for alert in notice.alerts))
    where = machines[0] if len(machines) == 1 else f"{len(machines)} machines"
    names = ", ".join(dict.fromkeys(alert.name for alert in (on or notice.alerts)))
    lead = "after quiet hours: " if notice.kind == "digest" else ""
    return f"{lead}[{state}] {where}: {names}"[:TITLE_MAX]


def text(notice: Notice) -> str:
    """A line for each alert, then what else is to be said."""
    return "\n".join([*(_line(alert) for alert in notice.alerts[:ALERTS_A_BODY_MAX]), *notice.notes])[:TEXT_MAX]


def _line(alert: Alert) -> str:
    if not alert.is_on:
        ended = iso(max(alert.ended_ms, alert.episode))
        return f"over: {alert.name} on {alert.machine} from {iso(alert.episode)} to {ended}"
    acknowledged = f", acknowledged by {alert.acknowledged_by}" if alert.phase is Phase.ACKNOWLEDGED else ""
    context = f" ({alert.context})" if alert.context else ""
    unknown = f"; now unknown: {alert.unknown}" if alert.unknown else ""
    return f"{alert.severity.value}: {alert.name} on {alert.machine} since {iso(alert.episode)}{context}{acknowledged}{unknown}"


def worst_of(alerts: Iterable[Alert]) -> Severity | None:
    """The highest severity among them."""
    return max((alert.severity for alert in alerts), key=lambda severity: severity.rank, default=None)
