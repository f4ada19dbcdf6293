"""Apprise: whatever service its address names. It says yes or no, not why: a no may have arrived all the same."""

import importlib
import logging
import re
import warnings
from typing import Any

from processors.alerts.courier.outcome import Outcome, Verdict
from processors.alerts.notification import Notification
from processors.errors import ConfigurationError

TEAMS = ("msteams", "workflow", "workflows")
"""Schemes of Microsoft Teams, which shows a link and a new line only where they are Markdown."""
_MARKS = re.compile(r"[\\`*_{}\[\]()<>#+!|~-]")


class AppriseService:
    """See the module. Raises ConfigurationError where Apprise is not installed or does not know the address."""

    def __init__(self, url: str, timeout_s: float) -> None:
        logging.getLogger("apprise").setLevel(logging.CRITICAL + 1)  # it logs addresses, which hold the secret
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of its 170 services, some are built on what Python will drop
            self._apprise = self._opened(url, timeout_s)
        self._is_teams = url.partition("://")[0] in TEAMS
        self._types = {"high": "failure", "medium": "warning", "low": "info", "none": "success"}

    @staticmethod
    def _opened(url: str, timeout_s: float) -> Any:
        try:
            apprise: Any = importlib.import_module("apprise")
        except ModuleNotFoundError:
            raise ConfigurationError("Apprise is not installed; pip install 'cnctwin[apprise]' brings it") from None
        joint = "&" if "?" in url else "?"
        limits = f"{joint}cto={min(timeout_s, 5.0):g}&rto={timeout_s:g}"
        opened = apprise.Apprise(asset=apprise.AppriseAsset(app_id="cnctwin", secure_logging=True))
        if not opened.add(url + limits) and not opened.add(url):
            raise ConfigurationError("Apprise does not know what to do with this address; `apprise --details` lists services")
        return opened

    def send(self, message: Notification) -> Outcome:
        """Send one notification."""
        kind = self._types.get(message.severity, "info")
        try:
            body, form = (_markdown(message), "markdown") if self._is_teams else (_plain(message), "text")
            is_sent = self._apprise.notify(body=body, title=message.title, notify_type=kind, body_format=form)
        except Exception as error:  # of any of some 170 services
            return Outcome(Verdict.UNSURE, f"Apprise failed with {type(error).__name__}; it may have arrived")
        if is_sent:
            return Outcome(Verdict.DELIVERED)
        return Outcome(Verdict.UNSURE, "Apprise says that it failed, and not why; it may have arrived")


def _plain(message: Notification) -> str:
    """Return the text with the link in a line of its own, which every service makes one to be followed."""
    link = f"{message.link_title}: {message.link}" if message.link else ""
    return "\n".join(filter(None, (message.text, link))) or message.title


def _markdown(message: Notification) -> str:
    r"""Return the same as Markdown, each line a paragraph.

    >>> _MARKS.sub(r"\\\g<0>", "part_7 (2)")
    'part\\_7 \\(2\\)'
    """
    lines = [_MARKS.sub(r"\\\g<0>", line) for line in (message.text or message.title).splitlines()]
    if message.link:
        lines.append(f"[{_MARKS.sub(r'', message.link_title)}]({message.link})")
    return "\n\n".join(lines)
