"""The service that speaks to a receiver, and the choice of the file that does."""

import os
from collections.abc import Mapping
from typing import Protocol

from processors.alerts.courier.alertmanager import Alertmanager
from processors.alerts.courier.apprise_service import AppriseService
from processors.alerts.courier.outcome import Outcome
from processors.alerts.courier.pushover import Pushover
from processors.alerts.courier.secret import read_secret
from processors.alerts.courier.webhook import Webhook
from processors.alerts.notification import Notification
from processors.alerts.receivers import (
    AlertmanagerReceiver,
    AnyReceiver,
    AppriseReceiver,
    PushoverReceiver,
    names_secret,
    url_fault,
)
from processors.errors import ConfigurationError


class Service(Protocol):
    """One receiver. Whatever happens is an outcome."""

    def send(self, message: Notification) -> Outcome: ...


def service_of(name: str, receiver: AnyReceiver, environment: Mapping[str, str] = os.environ) -> Service:
    """Return what speaks to this receiver, its secrets read. Raises ConfigurationError."""
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
