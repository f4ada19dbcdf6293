"""Silences: alerts whose labels match are not told for a while."""

from collections.abc import Iterable
from fnmatch import fnmatchcase

from processors.alerts.config import AlertsConfig
from processors.alerts.state import Alert, Silence, labels_of


def matches(silence: Silence, alert: Alert, config: AlertsConfig, wall_s: float) -> bool:
    """Return True if a silence holds for this alert now; `*` and `?` in a value stand for any characters."""
    if not silence.starts_s <= wall_s < silence.ends_s:
        return False
    labels = labels_of(alert.machine, alert.name, alert.signal, config.labels) | {"severity": alert.severity.value}
    return all(fnmatchcase(labels.get(name, ""), pattern) for name, pattern in silence.matchers.items())


def silenced_by(silences: Iterable[Silence], alert: Alert, config: AlertsConfig, wall_s: float) -> str:
    """The id of the silence that holds; empty where none does."""
    return next((silence.id for silence in silences if matches(silence, alert, config, wall_s)), "")
