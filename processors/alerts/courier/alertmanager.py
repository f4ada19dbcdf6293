"""Alertmanager's own API: POST /api/v2/alerts.

An alert is known there by its labels, so that sending it twice does no harm, and what is unsure is simply sent again.
Alertmanager resolves an alert at its `endsAt`: what fires ends a few times resend_s from now, and is sent again before that.
"""

import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from processors.alerts.body import iso
from processors.alerts.courier.exchange import Request, exchanged, judged
from processors.alerts.courier.outcome import Outcome, Verdict
from processors.alerts.courier.webhook import headers
from processors.alerts.notification import Notification
from processors.alerts.receivers import AlertmanagerReceiver
from processors.alerts.statement import RAISED

PATH = "/api/v2/alerts"
RESENDS_TO_END = 4
SEVERITIES = ("low", "medium", "high")


class Alertmanager:
    """See the module."""

    def __init__(self, url: str, bearer: str | None, receiver: AlertmanagerReceiver) -> None:
        self._url, self._bearer = url.rstrip("/") + PATH, bearer
        self._timeout_s, self._lasts_s = receiver.timeout_s, RESENDS_TO_END * receiver.resend_s

    def send(self, message: Notification) -> Outcome:
        """Send the alerts of one notification."""
        raised = {statement.fingerprint for statement in message.statements if statement.what == RAISED}
        alerts = message.body.get("alerts") or [_bare(message)]
        return self._post(alerts_for(alerts, time.time(), self._lasts_s, raised), message.id)

    def refresh(self, alerts: Sequence[Mapping[str, Any]]) -> Outcome:
        """Send again what fires."""
        return self._post(alerts_for(alerts, time.time(), self._lasts_s), "refresh")

    def _post(self, alerts: Sequence[Mapping[str, Any]], key: str) -> Outcome:
        secrets = (self._url, self._bearer or "")
        request = Request("POST", self._url, headers(self._bearer, key), json=alerts, secrets=secrets)
        answer = exchanged(request, self._timeout_s)
        outcome = answer if isinstance(answer, Outcome) else judged(answer, request)
        return outcome._replace(verdict=Verdict.NOT_TAKEN) if outcome.verdict is Verdict.UNSURE else outcome


def alerts_for(
    alerts: Iterable[Mapping[str, Any]], now_s: float, lasts_s: float, raised: Collection[str] = ()
) -> list[dict[str, Any]]:
    """The alerts as the API takes them. One whose severity was raised is another one there: the lesser one ends now."""
    rows = []
    for alert in alerts:
        labels = {name: value for name, value in alert["labels"].items() if value}
        is_firing = alert.get("status") == "firing"
        ends_s = now_s + lasts_s if is_firing else min(_seconds(alert["endsAt"], now_s), now_s)
        rows.append(_row(alert, labels, ends_s))
        if is_firing and str(alert.get("fingerprint")) in raised:
            lesser = SEVERITIES[: SEVERITIES.index(labels["severity"])] if labels.get("severity") in SEVERITIES else ()
            rows += [_row(alert, labels | {"severity": severity}, now_s) for severity in lesser]
    return rows


def _row(alert: Mapping[str, Any], labels: Mapping[str, str], ends_s: float) -> dict[str, Any]:
    starts_s = min(_seconds(alert["startsAt"], ends_s), ends_s)
    row = {
        "labels": dict(labels),
        "annotations": dict(alert["annotations"]),
        "startsAt": iso(round(starts_s * 1000)),
        "endsAt": iso(round(ends_s * 1000)),
    }
    return {**row, "generatorURL": alert["generatorURL"]} if alert.get("generatorURL") else row


def _seconds(text: str, otherwise_s: float) -> float:
    try:
        return datetime.fromisoformat(text).astimezone(UTC).timestamp()
    except (ValueError, OverflowError):
        return otherwise_s


def _bare(message: Notification) -> dict[str, Any]:
    """A test or a heartbeat: an alert of its own, which ends by itself."""
    labels = {"alertname": f"cnctwin_{message.kind}"}
    annotations = {"summary": message.title}
    return {"labels": labels, "annotations": annotations, "status": "firing", "startsAt": iso(round(time.time() * 1000))}
