"""A machine in short: what an overview of fifty of them shows."""

from collections.abc import Iterable, Mapping
from typing import Any, Protocol

from cnctwin.api.value_object import Plain, plain
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals

SHOWN = {
    "exec_state": "exec_state",
    "program": "program",
    "tool_number": "tool_number",
    "alarm": "alarm",
    "spindle_load_pct": "spindle_load_pct",
    "spindle_rpm": "spindle_rpm",
    "alert_state": twin_signals.ALERT_STATE,
    "score": twin_signals.ADJUSTED_SCORE,
    "threshold": twin_signals.ANOMALY_THRESHOLD,
    "gated": twin_signals.TOOL_CHANGE_GATE,
    "growing": twin_signals.GAP_GROWING,
    "residual_k": twin_signals.SPINDLE_TEMP_RESIDUAL_K,
}
_KEYS = frozenset(SHOWN.values())


class SignalReading(Protocol):
    """A signal with its last reading."""

    reading: Reading


def is_key_signal(name: str) -> bool:
    """Return True if the overview follows a metric."""
    return name in _KEYS or twin_signals.is_gap(name)


def fleet_item(machine: str, online: bool, signals: Mapping[str, SignalReading]) -> dict[str, Any]:
    """One machine of the overview: last known values, null where one is bad or not known."""
    item: dict[str, Any] = {"machine": machine, "online": online}
    for title, name in SHOWN.items():
        told = signals.get(name)
        item[title] = None if told is None else _known(told.reading)
    gaps = [
        value for name, told in signals.items() if twin_signals.is_gap(name) and isinstance(value := _known(told.reading), float)
    ]
    item["gap"] = max(gaps, default=None)
    measured = [told.reading for name, told in signals.items() if not name.startswith(twin_signals.TWIN_PREFIX)]
    item["last_t"] = newest_ms(measured)
    return item


def newest_ms(readings: Iterable[Reading]) -> int | None:
    """Return the machine's own time by now: the newest stamp of a value, since nulls may be stamped by another clock."""
    return max((reading.timestamp_ms for reading in readings if reading.quality is not Quality.BAD), default=None)


def _known(reading: Reading) -> Plain:
    return None if reading.quality is Quality.BAD else plain(reading.value)[0]
