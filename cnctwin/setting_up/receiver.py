"""The receiver of alerts that an answer names: its table in processors.toml, and the secrets that the table only names.

pushover            a phone, by Pushover: PUSHOVER_TOKEN, PUSHOVER_USER
https://…           a webhook (on this computer http:// too); the address often holds a secret, so it is one: CNCTWIN_ALERTS_URL
slack://…, …        whatever Apprise speaks; the address holds the secret: CNCTWIN_ALERTS_URL
"""

from pathlib import Path

from cnctwin.errors import UsageError
from cnctwin.setting_up.toml_text import with_key, without_table

NAME = "operators"
NONE, PUSHOVER = "none", "pushover"
ADDRESS, TOKEN, USER = "CNCTWIN_ALERTS_URL", "PUSHOVER_TOKEN", "PUSHOVER_USER"
_KINDS = {"pushover": (("token", TOKEN), ("user", USER)), "webhook": (("url", ADDRESS),), "apprise": (("url", ADDRESS),)}


def kind_of(answer: str) -> str:
    """Return the type of the receiver. Raises UsageError.

    >>> kind_of("pushover"), kind_of("https://hooks.plant.example/x"), kind_of("mailto://ada@plant.example")
    ('pushover', 'webhook', 'apprise')
    """
    if answer == PUSHOVER:
        return "pushover"
    scheme, found, _ = answer.partition("://")
    if not found or not scheme:
        raise UsageError(
            "alerts go to pushover, to an https:// address (or http:// on this computer), to an address of Apprise, or to none"
        )
    return "webhook" if scheme in ("http", "https") else "apprise"


def with_receiver(text: str, kind: str, path: Path) -> str:
    """Return processors.toml with the receiver of this type; what else stands in its table stays where the type does."""
    table = f"alerts.receivers.{NAME}"
    if f'type = "{kind}"' not in text.partition(f"[{table}]")[2].partition("\n[")[0]:
        text = without_table(text, table, path)
    text = with_key(text, table, "type", kind, path)
    for key, variable in _KINDS[kind]:
        text = with_key(text, table, key, f"${variable}", path)
    return text


def without_receiver(text: str, path: Path) -> str:
    """Return processors.toml without it."""
    return without_table(text, f"alerts.receivers.{NAME}", path)
