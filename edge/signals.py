"""The canonical signals: one name, one unit, one meaning, wherever a value travels.

A value outside the range that is physically possible becomes null with quality BAD and a reason that keeps the figure, for
instance "outside 0 to 200 %: 950". The figure is not clipped, because that would change raw data, and not passed on as the value
either, because then each consumer would have to look at the quality before it computes.

>>> signal("spindle_load_pct").plausible(950.0)
'outside 0 to 200 %: 950'
>>> signal("axis_x_pos_mm").unit
'mm'
"""

import re
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache

from edge.errors import ConfigError

EXEC_STATES = frozenset(
    {"ACTIVE", "READY", "INTERRUPTED", "FEED_HOLD", "STOPPED", "OPTIONAL_STOP", "PROGRAM_STOPPED", "PROGRAM_COMPLETED", "WAIT"}
)
CONTROLLER_MODES = frozenset({"AUTOMATIC", "MANUAL", "MANUAL_DATA_INPUT", "SEMI_AUTOMATIC", "EDIT"})


class Kind(Enum):
    """The kind of a signal's values."""

    NUMBER = "number"
    INTEGER = "integer"
    TEXT = "text"
    FLAG = "flag"


@dataclass(frozen=True, slots=True)
class Signal:
    """One canonical signal. `words` is the vocabulary of a text that has one."""

    name: str
    kind: Kind
    unit: str = ""
    low: float | None = None
    high: float | None = None
    words: frozenset[str] = frozenset()

    def plausible(self, value: float) -> str | None:
        """Why this number, in the canonical unit, cannot be; None where it can."""
        if self.low is None or self.high is None or self.low <= value <= self.high:
            return None
        return f"outside {self.low:g} to {self.high:g} {self.unit}: {value:g}"


def _number(name: str, unit: str, low: float, high: float) -> Signal:
    return Signal(name, Kind.NUMBER, unit, low, high)


_TABLE = (
    _number("spindle_rpm", "rev/min", -60_000, 60_000),  # a spindle that turns backwards: NIST's Hurcos read down to -175
    _number("spindle_rpm_cmd", "rev/min", -60_000, 60_000),
    _number("spindle_load_pct", "%", 0, 200),
    _number("spindle_power_kw", "kW", -500, 500),  # braking feeds power back
    _number("spindle_current_a", "A", -2_000, 2_000),
    _number("feed_mm_min", "mm/min", 0, 300_000),
    _number("feed_override_pct", "%", 0, 500),
    _number("rapid_override_pct", "%", 0, 500),
    _number("spindle_override_pct", "%", 0, 500),
    Signal("program", Kind.TEXT),
    Signal("nc_block", Kind.TEXT),
    Signal("nc_line", Kind.INTEGER),
    Signal("exec_state", Kind.TEXT, words=EXEC_STATES),
    Signal("controller_mode", Kind.TEXT, words=CONTROLLER_MODES),
    Signal("tool_number", Kind.INTEGER),
    Signal("tool_change_active", Kind.FLAG),
    Signal("tool_change_source", Kind.TEXT, words=frozenset({"controller", "detector", "none", "stale"})),
    Signal("tool_change_evidence", Kind.TEXT),
    Signal("tool_change_cue", Kind.FLAG),  # what a control says of itself, for `edge.tool_change`; never published
    # Controls that report whole degrees send 0 when they have no reading (a Mazak does, 1150 times in one day), and a spindle at
    # 0 °C is not found in a workshop: so 0 is no temperature here.
    _number("spindle_temp_c", "°C", 1, 150),
    _number("ambient_temp_c", "°C", -30, 70),
    _number("vibration_rms_g", "g", 0, 500),
    _number("vibration_velocity_mm_s", "mm/s", 0, 5_000),
    Signal("coolant_on", Kind.FLAG),
    Signal("alarm", Kind.TEXT),
    _number("clock_offset_s", "s", -1e12, 1e12),
    _number("clock_offset_spread_s", "s", 0, 1e12),
    Signal("stamp_clock", Kind.TEXT, words=frozenset({"control", "edge"})),
)
SIGNALS = {entry.name: entry for entry in _TABLE}
DERIVED = ("tool_change_active", "tool_change_source", "tool_change_evidence")

# An axis is a letter, with a digit where a control has several of one letter (Z and Z4 on a lathe with two carriages).
_AXES = (
    (re.compile(r"axis_[a-z]\d{0,2}_pos_mm"), _number("", "mm", -200_000, 200_000)),
    (re.compile(r"axis_[a-z]\d{0,2}_pos_deg"), _number("", "deg", -1e9, 1e9)),
    (re.compile(r"axis_[a-z]\d{0,2}_load_pct"), _number("", "%", -500, 500)),
)


@lru_cache(maxsize=4096)
def signal(name: str) -> Signal:
    """The signal of this canonical name, or ConfigError."""
    known = SIGNALS.get(name)
    if known is not None:
        return known
    for pattern, entry in _AXES:
        if pattern.fullmatch(name):
            return replace(entry, name=name)
    raise ConfigError(
        f"signal {name!r} is no canonical name; known are {', '.join(SIGNALS)} and axis_<letter>_pos_mm|pos_deg|load_pct"
    )
