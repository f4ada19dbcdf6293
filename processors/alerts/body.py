"""The content of a notification for programs: the JSON of Alertmanager's webhook, version 4."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from typing import Any

from processors.alerts.config import AlertsConfig
from processors.alerts.facts import Fact
from processors.alerts.phases import Flapping
from processors.alerts.state import Alert, Phase, Severity, fingerprint, labels_of
from processors.alerts.words.wording import Occasion, Wording, began_ms
from processors.config import Configuration

ALERTS_A_BODY_MAX = 50
FACTS_TOLD = ("value", "limit", "unit", "program", "tool", "line")
TEST = "test"
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


def as_alert(alert: Alert, config: AlertsConfig, words: Wording, flapping: Flapping | None = None) -> dict[str, Any]:
    """Return one alert as Alertmanager writes it; config: that of its machine. It stays the same while nothing happens, but for
    one that comes and goes."""
    labels = labels_of(alert.machine, alert.name, alert.signal, config.labels) | {"severity": alert.severity.value}
    annotations = {"summary": f"{alert.machine}: {words.summary(alert, flapping)}"}
    told = {"description": words.details(alert, flapping), "advice": words.advice(alert, flapping)}
    told |= {name: _written(alert.facts[name]) for name in FACTS_TOLD if name in alert.facts}
    told |= {name: _written(one) for name, one in words.comes_and_goes(alert, flapping).items()}
    told |= {"unknown": words.reason(alert), "acknowledged_by": alert.acknowledged_by}
    annotations |= {name: text for name, text in told.items() if text}
    return {
        "status": "firing" if alert.is_on else "resolved",
        "labels": labels,
        "annotations": annotations,
        "startsAt": iso(began_ms(alert)),
        "endsAt": NEVER if alert.is_on else iso(max(alert.ended_ms, alert.episode)),
        "generatorURL": words.link(alert),
        "fingerprint": alert.fingerprint,
        "episode": alert.episode,
    }


def _written(fact: Fact) -> str:
    return f"{fact:.6g}" if isinstance(fact, float) else str(fact)


def body(
    notice: Notice, configuration: Configuration[AlertsConfig], words: Wording, flapping: Mapping[str, Flapping], at_ms: int
) -> dict[str, Any]:
    """Return the webhook's JSON; flapping: by fingerprint, those of its alerts that come and go. A test holds one made-up alert,
    so that a receiver that shows only alerts shows it."""
    shown = [
        as_alert(alert, configuration.of(alert.machine), words, flapping.get(alert.fingerprint))
        for alert in notice.alerts[:ALERTS_A_BODY_MAX]
    ]
    is_test = notice.kind == TEST
    if is_test:
        shown = [_made_up(notice, configuration.default, words, at_ms)]
    return {
        "version": "4",
        "groupKey": notice.group,
        "truncatedAlerts": max(0, len(notice.alerts) - ALERTS_A_BODY_MAX),
        "status": "firing" if is_test or any(alert.is_on for alert in notice.alerts) else "resolved",
        "receiver": notice.receiver,
        "groupLabels": dict(notice.group_labels),
        "commonLabels": _common([alert["labels"] for alert in shown]),
        "commonAnnotations": _common([alert["annotations"] for alert in shown]),
        "externalURL": configuration.default.external_url,
        "alerts": shown,
    }


def _made_up(notice: Notice, config: AlertsConfig, words: Wording, at_ms: int) -> dict[str, Any]:
    """Return the alert of a test: it says that it is one, and is of no machine."""
    key = fingerprint(labels_of(TEST, "cnctwin_test", "", {}))
    alert = as_alert(Alert(TEST, "cnctwin_test", "", key, Severity.LOW, at_ms, Phase.FIRING), AlertsConfig(), words)
    said = {"summary": words.title((), Occasion(0.0, TEST)), "description": "\n".join(notice.notes), "test": "true"}
    return alert | {"annotations": said, "generatorURL": config.external_url}


def _common(dictionaries: Sequence[Mapping[str, str]]) -> dict[str, str]:
    if not dictionaries:
        return {}
    first, *rest = dictionaries
    return {name: value for name, value in first.items() if all(other.get(name) == value for other in rest)}


def worst_of(alerts: Iterable[Alert]) -> Severity | None:
    """The highest severity among them."""
    return max((alert.severity for alert in alerts), key=lambda severity: severity.rank, default=None)
