"""A notification in the outbox on the broker: JSON, written by the alerts processor, read by it and by the courier."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from processors.alerts.body import ALERTS_A_BODY_MAX, Notice, body, iso, worst_of
from processors.alerts.phases import Flapping, flapping_of
from processors.alerts.statement import Statement, statements_in
from processors.alerts.words.wording import Occasion
from processors.alerts.words.wordings import Alerts, wording_of

SAYS_MAX, SAYS_CHARACTERS_MAX = 5000, 200
Name = Annotated[str, Field(min_length=1, max_length=64)]


def written(key: str, notice: Notice, configuration: Alerts, wall_s: float, clock_s: float) -> str:
    """Return the JSON of a notice with the id `key`; `Notification.of` reads it."""
    words = wording_of(configuration, notice.receiver)
    occasion = Occasion(clock_s, notice.kind, statements_in(notice.says), _flapping(notice, configuration, clock_s))
    new = notice.alerts[: len(occasion.says)]  # the rest stands only: an end rings for nothing of it
    worst = worst_of(alert for alert in new if alert.is_on)
    first = next((alert for alert in new if alert.is_on), next(iter(notice.alerts), None))
    document = {
        "id": key,
        "receiver": notice.receiver,
        "kind": notice.kind,
        "severity": worst.value if worst is not None else "none",
        "title": words.title(notice.alerts, occasion),
        "text": words.text(notice.alerts, notice.notes, occasion),
        "link": "" if first is None else words.link(first),
        "link_title": words.link_title,
        "says": list(notice.says),
        "created": iso(round(wall_s * 1000)),
        "expires_s": wall_s + notice.expires_s,
        "body": body(notice, configuration, words, occasion.flapping, round(wall_s * 1000)),
    }
    return json.dumps(document, separators=(",", ":"), ensure_ascii=False)


def _flapping(notice: Notice, configuration: Alerts, clock_s: float) -> dict[str, Flapping]:
    """Return those of its alerts that come and go, by fingerprint."""
    found = {alert.fingerprint: flapping_of(alert, clock_s, configuration.of(alert.machine)) for alert in notice.alerts}
    return {key: flapping for key, flapping in found.items() if flapping is not None}


class _Model(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False, strict=True)


class WrittenAlert(_Model):
    """One alert of a notification: the part of its JSON that identifies it."""

    fingerprint: Name
    labels: dict[str, str]
    annotations: dict[str, str] = {}
    started: str = Field(default="", alias="startsAt")
    ended: str = Field(alias="endsAt")
    episode: int = Field(default=0, ge=0)


class _Body(_Model):
    alerts: list[WrittenAlert] = Field(default=[], max_length=ALERTS_A_BODY_MAX)


class _Document(_Model):
    id: Name
    receiver: Name
    kind: Name
    severity: str
    title: str
    text: str
    link: str = ""
    link_title: str = ""
    says: list[Annotated[str, Field(max_length=SAYS_CHARACTERS_MAX)]] = Field(max_length=SAYS_MAX)
    created: str = ""
    expires_s: float
    body: _Body


@dataclass(frozen=True, slots=True)
class Notification:
    """A notification that was read.

    statements: those lines of `says` that are about an alert
    link, link_title: the moment that it is about, on the page; empty without one
    body: Alertmanager's JSON as it was written; `alerts` are the checked ones in it
    """

    id: str
    receiver: str
    kind: str
    severity: str
    title: str
    text: str
    link: str
    link_title: str
    says: tuple[str, ...]
    statements: tuple[Statement, ...]
    created: str
    expires_s: float
    body: Mapping[str, Any]
    alerts: tuple[WrittenAlert, ...]

    @classmethod
    def of(cls, payload: bytes | str) -> "Notification":
        """Return the notification that a payload holds. Raises ValueError (RecursionError for JSON that is nested too deep)."""
        document = json.loads(payload)
        read = _Document.model_validate(document)
        return cls(
            read.id,
            read.receiver,
            read.kind,
            read.severity,
            read.title,
            read.text,
            read.link,
            read.link_title,
            tuple(read.says),
            statements_in(read.says),
            read.created,
            read.expires_s,
            document["body"],
            tuple(read.body.alerts),
        )
