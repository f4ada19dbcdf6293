"""A machine in short: what an overview of fifty of them shows."""

from collections.abc import Mapping
from typing import Any, Protocol

from cnctwin.api.value_object import Plain, plain
from cnctwin.plant.view import TWIN_PREFIX
from sparkplug.metric import Reading
from sparkplug.quality import Quality

GAP = f"{TWIN_PREFIX}gap_"
GROWING = f"{GAP}growing"
_NO_FIGURE = frozenset({f"{GAP}growing_signal", f"{GAP}window", f"{GAP}left_out_pct", f"{GAP}basis"})
GATE = f"{TWIN_PREFIX}tool_change_gate"
SHOWN = {
    "exec_state": "exec_state",
    "program": "program",
    "tool_number": "tool_number",
    "alarm": "alarm",
    "spindle_load_pct": "spindle_load_pct",
    "spindle_rpm": "spindle_rpm",
    "alert_state": f"{TWIN_PREFIX}alert_state",
    "score": f"{TWIN_PREFIX}adjusted_score",
    "threshold": f"{TWIN_PREFIX}anomaly_threshold",
    "gated": GATE,
    "growing": GROWING,
    "residual_k": f"{TWIN_PREFIX}spindle_temp_residual_k",
}
_KEYS = frozenset(SHOWN.values())


class SignalReading(Protocol):
    """A signal with its last reading."""

    reading: Reading


def is_gap_figure(name: str) -> bool:
    """Return True if a metric is the standing gap of a signal over all its regimes.

    >>> is_gap_figure("twin/gap_spindle_rpm"), is_gap_figure("twin/gap_spindle_load_pct/air"), is_gap_figure("twin/gap_basis")
    (True, False, False)
    """
    return name.startswith(GAP) and "/" not in name[len(GAP) :] and name != GROWING and name not in _NO_FIGURE


def is_key_signal(name: str) -> bool:
    """Return True if the overview follows a metric."""
    return name in _KEYS or is_gap_figure(name)


def fleet_item(machine: str, online: bool, signals: Mapping[str, SignalReading]) -> dict[str, Any]:
    """One machine of the overview: last known values, null where one is bad or not known."""
    item: dict[str, Any] = {"machine": machine, "online": online}
    for title, name in SHOWN.items():
        told = signals.get(name)
        item[title] = None if told is None else _known(told.reading)
    gaps = [value for name, told in signals.items() if is_gap_figure(name) and isinstance(value := _known(told.reading), float)]
    item["gap"] = max(gaps, default=None)
    measured = (told.reading.timestamp_ms for name, told in signals.items() if not name.startswith(TWIN_PREFIX))
    item["last_t"] = max(measured, default=None)
    return item


def _known(reading: Reading) -> Plain:
    return None if reading.quality is Quality.BAD else plain(reading.value)[0]
