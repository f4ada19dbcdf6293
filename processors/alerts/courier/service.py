"""What the courier needs of a receiver, and which file speaks to which."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from processors.alerts.courier.outcome import Outcome
from processors.alerts.courier.secret import read_secret
from processors.alerts.receivers import (
    AlertmanagerReceiver,
    AnyReceiver,
    AppriseReceiver,
    PushoverReceiver,
    names_secret,
    url_fault,
)
from processors.errors import ConfigurationError


@dataclass(frozen=True, slots=True)
class Message:
    """A notification out of the outbox. Raises nothing: `of` gives None for what is none."""

    id: str
    receiver: str
    kind: str
    severity: str
    title: str
    text: str
    says: tuple[str, ...]
    expires_s: float
    body: Mapping[str, Any]

    @classmethod
    def of(cls, payload: bytes) -> "Message | None":
        """The notification that this payload holds."""
        try:
            document = json.loads(payload)
            key, receiver, kind = document["id"], document["receiver"], document["kind"]
            severity, title, text = document["severity"], document["title"], document["text"]
            says, body, expires_s = list(document["says"]), document["body"], float(document["expires_s"])
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
            return None
        texts = [key, receiver, kind, severity, title, text, *says]
        if not all(isinstance(one, str) for one in texts) or not isinstance(body, dict):
            return None
        return cls(key, receiver, kind, severity, title, text, tuple(says), expires_s, body)


class Service(Protocol):
    """One receiver. Whatever happens is an outcome."""

    def send(self, message: Message) -> Outcome: ...


def service_of(name: str, receiver: AnyReceiver, environment: Mapping[str, str] = os.environ) -> Service:
    """What speaks to this receiver, its secrets read. Raises ConfigurationError."""
    # One that is not used is not loaded.
    from processors.alerts.courier.alertmanager import Alertmanager  # noqa: PLC0415
    from processors.alerts.courier.apprise_service import AppriseService  # noqa: PLC0415
    from processors.alerts.courier.pushover import Pushover  # noqa: PLC0415
    from processors.alerts.courier.webhook import Webhook  # noqa: PLC0415

    try:
        if isinstance(receiver, AppriseReceiver):
            return AppriseService(read_secret(receiver.url, environment), receiver.timeout_s)
        url = _address(receiver.url, environment)
        if isinstance(receiver, PushoverReceiver):
            return Pushover(receiver, url, read_secret(receiver.token, environment), read_secret(receiver.user, environment))
        bearer = None if receiver.bearer is None else read_secret(receiver.bearer, environment)
        if isinstance(receiver, AlertmanagerReceiver):
            return Alertmanager(url, bearer, receiver)
        return Webhook(url, bearer, receiver.timeout_s)
    except ConfigurationError as error:
        raise ConfigurationError(f"[alerts.receivers.{name}] {error}") from None


def _address(url: str, environment: Mapping[str, str]) -> str:
    if not names_secret(url):
        return url
    address = read_secret(url, environment)
    fault = url_fault(address)
    if fault is not None:
        raise ConfigurationError(f"the address in {url} {fault}")
    return address
