"""The wordings of a configuration: that of each language that it names, read once with it."""

from collections.abc import Mapping

from processors.alerts.config import AlertsConfig
from processors.alerts.words.language import SUFFIX
from processors.alerts.words.wording import Wording, wording
from processors.config import Configuration

Alerts = Configuration[AlertsConfig]


def read_wordings(configuration: Alerts) -> Mapping[str, Wording]:
    """Return the wordings of the languages that are files. Raises ValueError where one is not there or cannot be read."""
    config = configuration.default
    named = {config.language, *(one.language for one in config.receivers.values())} - {""}
    found = {name: wording(name, config.time_zone, config.external_url) for name in sorted(named)}
    return {name: one for name, one in found.items() if name.endswith(SUFFIX)}


def wording_of(configuration: Alerts, receiver: str = "") -> Wording:
    """Return the wording that a receiver is told in; that of the broker's own state without one."""
    config = configuration.default
    known = config.receivers.get(receiver)
    name = (known.language if known is not None else "") or config.language
    read: Wording | None = configuration.read.get(name)
    return read if read is not None else wording(name, config.time_zone, config.external_url)
