"""A notification in the outbox on the broker: JSON, written by the alerts processor, read by it and by the courier."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from processors.alerts.body import ALERTS_A_BODY_MAX, Notice, body, iso, text, title, worst_of
from processors.alerts.config import AlertsConfig
from processors.alerts.statement import Statement, statements_in

SAYS_MAX, SAYS_CHARACTERS_MAX = 5000, 200
Name = Annotated[str, Field(min_length=1, max_length=64)]


def written(key: str, notice: Notice, config: AlertsConfig, wall_s: float) -> str:
    """Return the JSON of a notice with the id `key`; `Notification.of` reads it."""
    worst = worst_of(alert for alert in notice.alerts if alert.is_on)
    document = {
        "id": key,
        "receiver": notice.receiver,
        "kind": notice.kind,
        "severity": worst.value if worst is not None else "none",
        "title": title(notice),
        "text": text(notice),
        "says": list(notice.says),
        "created": iso(round(wall_s * 1000)),
        "expires_s": wall_s + notice.expires_s,
        "body": body(notice, config),
    }
    return json.dumps(document, separators=(",", ":"), ensure_ascii=False)


class _Model(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False, strict=True)


class WrittenAlert(_Model):
    """One alert of a notification: the part of Alertmanager's JSON that identifies it."""

    fingerprint: Name
    labels: dict[str, str]
    annotations: dict[str, str] = {}
    ended: str = Field(alias="endsAt")


class _Body(_Model):
    alerts: list[WrittenAlert] = Field(default=[], max_length=ALERTS_A_BODY_MAX)


class _Document(_Model):
    id: Name
    receiver: Name
    kind: Name
    severity: str
    title: str
    text: str
    says: list[Annotated[str, Field(max_length=SAYS_CHARACTERS_MAX)]] = Field(max_length=SAYS_MAX)
    created: str = ""
    expires_s: float
    body: _Body


@dataclass(frozen=True, slots=True)
class Notification:
    """A notification that was read.

    statements: those lines of `says` that are about an alert
    body: Alertmanager's JSON as it was written; `alerts` are the checked ones in it
    """

    id: str
    receiver: str
    kind: str
    severity: str
    title: str
    text: str
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
            tuple(read.says),
            statements_in(read.says),
            read.created,
            read.expires_s,
            document["body"],
            tuple(read.body.alerts),
        )
