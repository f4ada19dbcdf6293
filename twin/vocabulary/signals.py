"""The canonical signals: one name, one unit, one meaning, wherever a value travels.

A value outside the range that is physically possible becomes null with quality BAD and a reason that keeps the figure, for
instance "outside 0 to 200 %: 950". The figure is not clipped, because that would change raw data, and not passed on as the value
either, because then each consumer would have to look at the quality before it computes.

>>> SIGNALS["spindle_load_pct"].plausible(950.0)
'outside 0 to 200 %: 950'
>>> canonical("axis_x_pos_mm").unit
'mm'
>>> canonical("variable_part_width").kind, canonical("plc_7") is None
(<Kind.NUMBER: 'number'>, True)
"""

import re
from dataclasses import dataclass, replace
from enum import Enum

EXEC_STATES = frozenset(
    {"ACTIVE", "READY", "INTERRUPTED", "FEED_HOLD", "STOPPED", "OPTIONAL_STOP", "PROGRAM_STOPPED", "PROGRAM_COMPLETED", "WAIT"}
)
CONTROLLER_MODES = frozenset({"AUTOMATIC", "MANUAL", "MANUAL_DATA_INPUT", "SEMI_AUTOMATIC", "EDIT"})
# An alarm, in the signals `alarms` and `alarm_history`: null where the control does not tell.
ALARM_FIELDS = ("code", "text", "severity", "active", "acknowledged", "since")


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
    meaning: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    words: frozenset[str] = frozenset()

    def plausible(self, value: float) -> str | None:
        """Why this number, in the canonical unit, cannot be; None where it can."""
        if self.low is None or self.high is None or self.low <= value <= self.high:
            return None
        return f"outside {self.low:g} to {self.high:g} {self.unit}: {value:g}"


def _number(name: str, unit: str, low: float, high: float, meaning: str) -> Signal:
    return Signal(name, Kind.NUMBER, meaning, unit, low, high)


def _text(name: str, meaning: str, words: frozenset[str] = frozenset()) -> Signal:
    return Signal(name, Kind.TEXT, meaning, words=words)


_TABLE = (
    # A spindle that turns backwards: NIST's Hurcos read down to -175.
    _number("spindle_rpm", "rev/min", -60_000, 60_000, "speed of the spindle, negative where it turns backwards"),
    _number("spindle_rpm_cmd", "rev/min", -60_000, 60_000, "speed that the control asks of the spindle"),
    _number("spindle_load_pct", "%", 0, 200, "load of the spindle drive, of its rated load"),
    _number("spindle_power_kw", "kW", -500, 500, "power of the spindle drive, negative where braking feeds it back"),
    _number("spindle_current_a", "A", -2_000, 2_000, "current of the spindle drive"),
    _number("feed_mm_min", "mm/min", 0, 300_000, "feed along the path"),
    _number("feed_override_pct", "%", 0, 500, "override of the feed"),
    _number("rapid_override_pct", "%", 0, 500, "override of rapid traverse"),
    _number("spindle_override_pct", "%", 0, 500, "override of the spindle speed"),
    _text("program", "name of the NC program"),
    _text("nc_block", "text of the block that is executed"),
    Signal("nc_line", Kind.INTEGER, "number of the line that is executed"),
    _text("exec_state", "what the control does with the program", EXEC_STATES),
    _text("controller_mode", "operating mode of the control", CONTROLLER_MODES),
    Signal("tool_number", Kind.INTEGER, "number of the tool in the spindle"),
    Signal("tool_change_active", Kind.FLAG, "a tool change is in progress"),
    _text("tool_change_source", "what tool_change_active rests on", frozenset({"controller", "detector", "none", "stale"})),
    _text("tool_change_evidence", "what the control showed when the tool change began"),
    Signal("tool_change_cue", Kind.FLAG, "the control itself reports a tool change; evidence, never published"),
    # Controls that report whole degrees send 0 when they have no reading (a Mazak does, 1150 times in one day), and a spindle at
    # 0 °C is not found in a workshop: so 0 is no temperature here.
    _number("spindle_temp_c", "°C", 1, 150, "temperature of the spindle"),
    _number("ambient_temp_c", "°C", -30, 70, "temperature of the air around the machine"),
    _number("vibration_rms_g", "g", 0, 500, "vibration as acceleration, rms"),
    _number("vibration_velocity_mm_s", "mm/s", 0, 5_000, "vibration as velocity, rms"),
    Signal("coolant_on", Kind.FLAG, "the coolant flows"),
    _text("alarm", "alarms that the control shows"),
    _text("part_quality", "good or scrap, of the part that ended last; a serial number may follow"),
    _text("alarms", "the active alarms as a JSON list, each an object with " + ", ".join(f"`{field}`" for field in ALARM_FIELDS)),
    _text("alarm_history", "the last entries of the control's own alarm log as a JSON list like `alarms`, newest last"),
    _text("operator_message", "messages to the operator that the control shows"),
    _text("program_comment", "comment of the NC program in its head"),
    _number("tool_life_used_min", "min", 0, 1e6, "cutting time of the tool in the spindle, as the control counts it"),
    _number("tool_life_limit_min", "min", 0, 1e6, "cutting time at which the control calls that tool worn"),
    Signal("tool_life_used_count", Kind.INTEGER, "uses of the tool in the spindle, as the control counts them"),
    Signal("tool_life_limit_count", Kind.INTEGER, "number of uses at which the control calls that tool worn"),
    _number(
        "tool_length_mm",
        "mm",
        -10_000,
        10_000,
        "length of the tool in the spindle, by the control's own offset in force, without wear",
    ),
    _number("tool_radius_mm", "mm", -1_000, 1_000, "radius of that tool, likewise"),
    _number("tool_length_wear_mm", "mm", -1_000, 1_000, "wear offset of the length of that tool"),
    _number("tool_radius_wear_mm", "mm", -1_000, 1_000, "wear offset of the radius of that tool"),
    _number("clock_offset_s", "s", -1e12, 1e12, "clock of the control minus clock of the edge"),
    _number("clock_offset_spread_s", "s", 0, 1e12, "how far clock_offset_s may be off"),
    _text("stamp_clock", "the clock that values are stamped by", frozenset({"control", "edge"})),
)
SIGNALS = {entry.name: entry for entry in _TABLE}
OVERRIDES = ("feed_override_pct", "rapid_override_pct", "spindle_override_pct")
DERIVED = ("tool_change_active", "tool_change_source", "tool_change_evidence")
ADDED = frozenset((*DERIVED, "clock_offset_s", "clock_offset_spread_s", "stamp_clock", "edge_sequence"))
"""Names that an edge adds to the signals of a control."""
# Beside the canonical signals: raw samples of an accelerometer, an array, which the processor `vibration` reads.
VIBRATION_BLOCK_G, VIBRATION_SAMPLE_RATE_HZ = "vibration_block_g", "vibration_sample_rate_hz"
# Lengths that the gap takes from canonical signals: of a tool change, and of a section of a program between two of them.
TOOL_CHANGE_S, PROGRAM_TIME_S = "tool_change_s", "program_time_s"

# An axis is a letter, with a digit where a control has several of one letter (Z and Z4 on a lathe with two carriages).
AXES = (
    (re.compile(r"axis_[a-z]\d{0,2}_pos_mm"), _number("", "mm", -200_000, 200_000, "position of a linear axis")),
    (re.compile(r"axis_[a-z]\d{0,2}_pos_deg"), _number("", "deg", -1e9, 1e9, "position of a rotary axis")),
    (re.compile(r"axis_[a-z]\d{0,2}_load_pct"), _number("", "%", -500, 500, "load of an axis drive, of its rated load")),
)

# Signals that the configuration of an edge chooses and names. Their unit stands there too, and whether a PLC address is a flag.
VARIABLE_PREFIX, PLC_PREFIX = "variable_", "plc_"
CHOSEN_NAME = r"[a-z][a-z0-9_]{0,31}"
CHOSEN = (
    (
        re.compile(VARIABLE_PREFIX + CHOSEN_NAME),
        Signal("", Kind.NUMBER, "a variable of the control: macro variable, R or Q parameter; unit by configuration"),
    ),
    (
        re.compile(PLC_PREFIX + CHOSEN_NAME),
        Signal("", Kind.NUMBER, "an address of the control's PLC; unit by configuration, which may declare it a flag"),
    ),
)


def canonical(name: str) -> Signal | None:
    """Return the signal of this canonical name, or None if there is none."""
    known = SIGNALS.get(name)
    if known is not None:
        return known
    return next((replace(entry, name=name) for pattern, entry in (*AXES, *CHOSEN) if pattern.fullmatch(name)), None)
