"""The meaning of the values of a look: which fact feeds which signal, and the words for the control's numbers.

| program state | `exec_state` | | execution mode | `controller_mode` |
|---|---|---|---|---|
| 0 started | ACTIVE | | 0 manual, 2 pass references | MANUAL |
| 1 stopped, 4 interrupted | INTERRUPTED | | 1 MDI | MANUAL_DATA_INPUT |
| 2 finished | PROGRAM_COMPLETED | | 3 single step | SEMI_AUTOMATIC |
| 3 cancelled, 5 error, 6 error cleared | STOPPED | | 4 automatic | AUTOMATIC |
| 7 idle | READY | | | |
"""

import re
from functools import lru_cache

from edge.chosen import Chosen
from edge.config import SignalSection
from edge.controls.heidenhain.config import Config
from edge.errors import ConfigError
from edge.reading import Target
from edge.signals import signal
from edge.sweep import Plain
from edge.units import conversion
from twin.vocabulary.signals import Kind

EXEC_STATES = {0: "ACTIVE", 1: "INTERRUPTED", 2: "PROGRAM_COMPLETED", 3: "STOPPED", 4: "INTERRUPTED", 5: "STOPPED"}
EXEC_STATES |= {6: "STOPPED", 7: "READY"}
MODES = {0: "MANUAL", 1: "MANUAL_DATA_INPUT", 2: "MANUAL", 3: "SEMI_AUTOMATIC", 4: "AUTOMATIC"}
SIGNALS = {
    "program_state": "exec_state",
    "execution_mode": "controller_mode",
    "program": "program",
    "line": "nc_line",
    "feed_override": "feed_override_pct",
    "spindle_override": "spindle_override_pct",
    "rapid_override": "rapid_override_pct",
    "tool": "tool_number",
    "errors": "alarm",
    "error_list": "alarms",
    "tool_length": "tool_length_mm",
    "tool_radius": "tool_radius_mm",
}
SOURCES = {
    "program_state": "R_RI 26",
    "execution_mode": "R_RI 23",
    "program": "R_RI 24",
    "line": "R_RI 24",
    "feed_override": "R_RI 25",
    "spindle_override": "R_RI 25",
    "rapid_override": "R_RI 25",
    "tool": "R_RI 51",
    "errors": "R_RI 27, 28",
    "error_list": "R_RI 27, 28",
    "tool_length": "R_RI 51",
    "tool_radius": "R_RI 51",
}
# What no LSV2 telegram tells, on any control: only the builder of the machine knows in which PLC address it lies.
ONLY_PLC = ("spindle_rpm", "spindle_load_pct", "feed_mm_min")
BACKSLASHES = "\\/"  # a data path begins with either
_ROTARY = frozenset("abc")


def signal_of(key: str) -> str | None:
    """The signal that a fact feeds; None where it feeds none.

    >>> [signal_of(key) for key in ("axis:Z", "axis:C", "plc:spindle_rpm", "override", "current_program")]
    ['axis_z_pos_mm', 'axis_c_pos_deg', 'spindle_rpm', None, None]
    """
    kind, _, name = key.partition(":")
    if kind in ("plc", "chosen"):
        return name if _is_signal(name) else None
    if kind == "axis":
        axis = name.lower()
        if not re.fullmatch(r"[a-z]\d{0,2}", axis):
            return None
        return f"axis_{axis}_pos_{'deg' if axis[0] in _ROTARY else 'mm'}"
    return SIGNALS.get(key)


@lru_cache(maxsize=256)
def _is_signal(name: str) -> bool:
    try:
        return bool(signal(name).name)
    except ConfigError:
        return False


def source_of(key: str, config: Config) -> str:
    """Return where a fact comes from, as births and `edge check` say it."""
    kind, _, name = key.partition(":")
    if kind == "plc":
        return f"PLC {config.source.plc.get(name, '?')}"
    if kind == "chosen":
        chosen = chosen_of(name, config)
        return "?" if chosen is None else f"{'R_DP' if chosen.address[0] in BACKSLASHES else 'PLC'} {chosen.address}"
    return f"R_RI 22 {name}" if kind == "axis" else SOURCES.get(key, key)


def chosen_of(name: str, config: Config) -> Chosen | None:
    """Return what [variables] or [plc] say of this signal."""
    return next((one for one in config.chosen if one.signal == name), None)


def in_words(key: str, value: Plain) -> Plain:
    """A number of the control as the word that the signal's vocabulary has for it; a path without its folder."""
    if key == "program_state":
        return EXEC_STATES.get(value) if isinstance(value, int) else None
    if key == "execution_mode":
        return MODES.get(value) if isinstance(value, int) else None
    if key == "program" and isinstance(value, str):
        return re.split(r"[\\/]", value)[-1]
    return value


def target_of(key: str, name: str, config: Config) -> Target:
    """Return how the value of a fact becomes that of a signal."""
    chosen = chosen_of(name, config) if key.startswith("chosen:") else None
    if chosen is not None:
        return chosen.target(key)
    section = config.signals.get(name, SignalSection())
    known = signal(name)
    factor, offset = conversion(section.native_unit, known.unit) if section.native_unit else (1.0, 0.0)
    low = known.low if section.low is None else section.low
    high = known.high if section.high is None else section.high
    scale = section.scale if known.kind is Kind.NUMBER else 1.0
    return Target(key, name, factor * scale, offset, low, high)
