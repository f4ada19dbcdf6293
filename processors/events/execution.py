"""The execution of a machine in MTConnect's words, and why it stands where it does: only what is known.

`exec_state` of the control is believed. Where a control has none, feed is taken for it: ACTIVE while it feeds, READY else. A
machine whose edge is offline is OFFLINE; a state that is null is unknown, which is not a state: what comes back after it as it
was before has not changed.
"""

from collections.abc import Mapping
from typing import NamedTuple

from processors.sample import Sample, why_unknown
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vocabulary import signals

EXECUTION, FEED, MODE, PROGRAM = "exec_state", "feed_mm_min", "controller_mode", "program"
ALARM, TOOL, CHANGING = "alarm", "tool_number", "tool_change_active"
OVERRIDES = signals.OVERRIDES
FEED_OVERRIDE = OVERRIDES[0]
ACTIVE, READY, COMPLETED, OFFLINE, WAIT = "ACTIVE", "READY", "PROGRAM_COMPLETED", "OFFLINE", "WAIT"
STATES = frozenset(
    {ACTIVE, READY, "INTERRUPTED", "FEED_HOLD", "STOPPED", "OPTIONAL_STOP", "PROGRAM_STOPPED", COMPLETED, WAIT, OFFLINE}
)
BY_CONTROL, BY_FEED = "told by the control", "taken from the feed: the control tells no execution state"
NOT_TOLD, NO_STOP, TOOL_CHANGE = "not told", "none", "tool change"
_BY_STATE = {
    "PROGRAM_STOPPED": "program stop (M0)",
    "OPTIONAL_STOP": "optional stop (M1)",
    "FEED_HOLD": "feed hold",
    WAIT: "waits for an event",
}
TEXT_MAX = 80
_GOOD, _STALE = Quality.GOOD, Quality.STALE


class Execution(NamedTuple):
    """The state, or None with the reason; and who tells it."""

    state: str | None
    reason: str = ""
    basis: str = BY_CONTROL


_TOLD = {state: Execution(state) for state in STATES}
_FED, _UNFED = Execution(ACTIVE, basis=BY_FEED), Execution(READY, basis=BY_FEED)


def execution(sample: Sample, feed_mm_min_min: float) -> Execution:
    """Return what the machine does, by its row.

    >>> from processors.sample import SampleKind
    >>> execution(Sample("vmc", SampleKind.TICK, 0.0, {}), 1.0)
    Execution(state=None, reason='exec_state is not offered', basis='told by the control')
    """
    row = sample.row
    reading = row.get(EXECUTION)
    if reading is None:
        feed = row.get(FEED)
        if feed is None:
            return Execution(None, f"{EXECUTION} is not offered")
        if feed.quality is _STALE and feed.reason != "not offered any more":
            return Execution(OFFLINE, basis=BY_FEED)
        mm_min, unknown = sample.number(FEED)
        if mm_min is None:
            return Execution(None, unknown or "", BY_FEED)
        return _FED if mm_min >= feed_mm_min_min else _UNFED
    if reading.quality is _STALE and reading.reason != "not offered any more":
        return Execution(OFFLINE)
    if (reason := why_unknown(reading)) is not None:
        return Execution(None, reason)
    if not isinstance(reading.value, str) or reading.value not in STATES:
        return Execution(None, f"{EXECUTION} is no state that is known")
    return _TOLD[reading.value]


def text(row: Mapping[str, Reading], name: str) -> str | None:
    """A good text of the row, cut to a length; None where there is none."""
    reading = row.get(name)
    if reading is None or reading.quality is not _GOOD or not isinstance(reading.value, str):
        return None
    return reading.value[:TEXT_MAX]


def tool(row: Mapping[str, Reading]) -> int | None:
    """The tool in the spindle; None where there is none, or it is not known."""
    reading = row.get(TOOL)
    if reading is None or reading.quality is not _GOOD or type(reading.value) is not int:
        return None
    return reading.value if abs(reading.value) < 2**31 else None


def is_changing_tool(row: Mapping[str, Reading]) -> bool:
    """Return True if a tool change is reported."""
    reading = row.get(CHANGING)
    return reading is not None and reading.quality is _GOOD and reading.value is True


def is_held_by_override(sample: Sample) -> bool:
    """Return True if the feed override stands at zero."""
    if FEED_OVERRIDE not in sample.row:
        return False
    percent, _ = sample.number(FEED_OVERRIDE)
    return percent is not None and percent <= 0.0


def stop_reason(state: str, sample: Sample) -> str:
    """Why the machine does not work, from what is told now; NOT_TOLD where nothing is.

    An alarm goes before all else; then what the program or the operator commanded; then what can be seen. A WARNING explains
    a stop only where nothing else does.
    """
    row = sample.row
    if state == OFFLINE:
        return "offline"
    reason = _BY_STATE.get(state)
    if is_changing_tool(row) and (reason is None or state == WAIT):
        reason = TOOL_CHANGE
    alarm = text(row, ALARM)
    if alarm and state != ACTIVE and (alarm.startswith("FAULT") or not _explains_more(reason, alarm)):
        return f"alarm: {alarm}"
    if reason is not None:
        return reason
    if is_held_by_override(sample):
        return "feed override 0 %"
    if state == COMPLETED:
        return "program completed"
    mode = text(row, MODE)
    if mode is not None and mode not in ("AUTOMATIC", "SEMI_AUTOMATIC"):
        return f"mode {mode}"
    return NOT_TOLD


def _explains_more(reason: str | None, alarm: str) -> bool:
    """Return True if a reason explains a stop better than an alarm that is no fault; a warning does not stop a tool change."""
    return reason is not None and (reason != TOOL_CHANGE or alarm.startswith("WARNING"))
