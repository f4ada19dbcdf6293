"""The receivers of alerts: one typed model for each kind.

No secret stands here. Where one is needed the configuration names the environment variable, `$NAME`, or a file that only its
owner can read, `file:/path`; the courier reads it when it starts.
"""

import re
from typing import Annotated, Literal
from urllib.parse import urlsplit

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

LOOPBACK = frozenset({"127.0.0.1", "::1", "localhost"})
_ENVIRONMENT = re.compile(r"\$[A-Za-z_][A-Za-z0-9_]*")
_FILE = re.compile(r"file:.+")


def names_secret(text: str) -> bool:
    """Return True if this is the name of a secret: `$NAME` or `file:/path`.

    >>> names_secret("$PUSHOVER_TOKEN"), names_secret("file:/etc/cnctwin/token"), names_secret("azGDORePK8gMaC0QOYAMyEEuzJnyUi")
    (True, True, False)
    """
    return bool(_ENVIRONMENT.fullmatch(text) or _FILE.fullmatch(text))


def url_fault(url: str) -> str | None:
    """Return the fault of an address that notifications go to; its path and query are never part of the answer.

    >>> url_fault("http://hooks.plant.example/x")
    "http://hooks.plant.example is not encrypted: use https:// (http:// is for this computer's loopback only)"
    """
    try:
        parts = urlsplit(url)
        host, _ = parts.hostname, parts.port
    except ValueError:
        return "is no address"
    if parts.scheme not in ("http", "https") or not host:
        return "is not https://host[:port]/path"
    if parts.username is not None or parts.password is not None:
        return f"of {host} holds a user name or a password; name them in bearer, or give the whole address as $NAME"
    if parts.scheme == "http" and host not in LOOPBACK:
        return f"http://{host} is not encrypted: use https:// (http:// is for this computer's loopback only)"
    return None


def _secret(text: str) -> str:
    if not names_secret(text):
        # The text itself may be the secret: it is not repeated.
        raise ValueError("a secret does not stand in the configuration: write $NAME_OF_A_VARIABLE or file:/path/to/a/file")
    return text


def _address(text: str) -> str:
    if not names_secret(text):
        fault = url_fault(text)
        if fault is None and urlsplit(text).query:
            fault = "has a query, which often holds a secret; give the whole address as $NAME or file:/path"
        if fault is not None:
            raise ValueError(f"the address {fault}")
    return text


Secret = Annotated[str, AfterValidator(_secret)]
Address = Annotated[str, AfterValidator(_address)]


class Receiver(BaseModel):
    """The settings that all receivers have.

    rate_per_hour: notifications that hold no high alert; more are held back, counted, and said with the next one
    rate_high_per_hour: notifications that hold a high alert
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, hide_input_in_errors=True)

    send_resolved: bool = True
    language: str = Field(default="", max_length=300, description="of titles and texts; that of [alerts] where it is empty")
    rate_per_hour: int = Field(default=20, ge=1, le=10_000)
    rate_high_per_hour: int = Field(default=60, ge=10, le=10_000)
    give_up_after_s: float = Field(default=3600.0, ge=0.0, le=86_400.0, description="retries where it was surely not taken")
    timeout_s: float = Field(default=10.0, ge=0.1, le=60.0)


class PushoverReceiver(Receiver):
    """Pushover. A high alert is an emergency: repeated every retry_s until somebody acknowledges it, for expire_s."""

    type: Literal["pushover"]
    token: Secret
    user: Secret
    url: Address = "https://api.pushover.net"
    device: str = Field(default="", max_length=25)
    priority_low: int = Field(default=-1, ge=-2, le=1)
    priority_medium: int = Field(default=0, ge=-2, le=1)
    priority_high: int = Field(default=2, ge=0, le=2)
    retry_s: int = Field(default=60, ge=30, le=10_800)
    expire_s: int = Field(default=3600, ge=30, le=10_800)
    poll_s: float = Field(default=5.0, ge=5.0, le=600.0, description="between two questions about receipts")


class WebhookReceiver(Receiver):
    """Any HTTP server that takes the JSON of Alertmanager's webhook, version 4."""

    type: Literal["webhook"]
    url: Address
    bearer: Secret | None = None


class AlertmanagerReceiver(Receiver):
    """Alertmanager's own API. `url` without /api/v2/alerts."""

    type: Literal["alertmanager"]
    url: Address
    bearer: Secret | None = None
    resend_s: float = Field(default=60.0, ge=5.0, le=600.0, description="what fires is sent again, so that it is not resolved")


class AppriseReceiver(Receiver):
    """Whatever Apprise speaks; its address holds the secret."""

    type: Literal["apprise"]
    url: Secret


AnyReceiver = Annotated[PushoverReceiver | WebhookReceiver | AlertmanagerReceiver | AppriseReceiver, Field(discriminator="type")]


class Escalation(BaseModel):
    """Whom to tell when nobody has acknowledged for so long, or a notification has failed."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    receiver: str
    after_s: float = Field(gt=0.0, le=7 * 86_400.0)


class Heartbeat(BaseModel):
    """A message at regular times, so that somebody notices when no more come. Off without a receiver."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    receiver: str = ""
    every_s: float = Field(default=300.0, ge=10.0, le=86_400.0)
