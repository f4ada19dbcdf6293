"""A machine in short: what an overview of fifty of them shows."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
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
NO_GAP = "no gap is computed for this machine: the processor gap, which does it, does not run"


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
    standing = [told.reading for name, told in signals.items() if twin_signals.is_gap(name)]
    gaps = [value for reading in standing if isinstance(value := _known(reading), float)]
    item["gap"] = max(gaps, default=None)
    item["gap_reason"] = None if gaps else _why_no_gap(standing)
    measured = [told.reading for name, told in signals.items() if not name.startswith(twin_signals.TWIN_PREFIX)]
    item["last_t"] = newest_ms(measured)
    return item


def _why_no_gap(standing: Sequence[Reading]) -> str:
    """Return the reason that most signals of the machine give; one that the machine does not offer has no say."""
    if not standing:
        return NO_GAP
    reasons = Counter(reading.reason or "not known yet" for reading in standing)
    said = [one for one in reasons.most_common() if not one[0].endswith("is not offered")] or reasons.most_common()
    return said[0][0]


def newest_ms(readings: Iterable[Reading]) -> int | None:
    """Return the machine's own time by now: the newest stamp of a value, since nulls may be stamped by another clock."""
    return max((reading.timestamp_ms for reading in readings if reading.quality is not Quality.BAD), default=None)


def _known(reading: Reading) -> Plain:
    return None if reading.quality is Quality.BAD else plain(reading.value)[0]
