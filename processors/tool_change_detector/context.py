"""Tool changes of a machine as far as they are known, and who reports them: its control, the detector, or nobody.

The control is believed first; the detector where the control tells nothing. A value holds until it is said otherwise, since
values are reported when they change; one whose source has died is stale, which is not "no".
"""

from collections.abc import Mapping
from typing import NamedTuple

from processors.sample import why_unknown
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals

ACTIVE = "tool_change_active"
DETECTED = twin_signals.TOOL_CHANGE_ACTIVE
INPUTS = frozenset({ACTIVE, DETECTED})
CONTROLLER, DETECTOR, NONE, STALE = "controller", "detector", "none", "stale"
_GOOD = Quality.GOOD


class ToolChangeContext(NamedTuple):
    """active: None where nobody can tell, then with the reason; since_s: event time at which that was said."""

    active: bool | None
    source: str
    since_s: float = 0.0
    reason: str | None = None


def tool_change_context(row: Mapping[str, Reading]) -> ToolChangeContext:
    """Return the tool change in a machine's row.

    >>> tool_change_context({}).reason
    'tool_change_active is not offered'
    """
    control, detected = row.get(ACTIVE), row.get(DETECTED)
    for reading, source in ((control, CONTROLLER), (detected, DETECTOR)):
        if reading is not None and type(reading.value) is bool and reading.quality is _GOOD:
            return ToolChangeContext(reading.value, source, reading.timestamp_ms / 1000)
    for reading in (control, detected):
        if reading is not None and reading.quality is Quality.STALE and type(reading.value) is bool:
            return ToolChangeContext(reading.value, STALE, reading.timestamp_ms / 1000, why_unknown(reading))
    if control is None and detected is None:
        return ToolChangeContext(None, NONE, reason=f"{ACTIVE} is not offered")
    said = control if control is not None and control.reason else detected or control
    assert said is not None
    return ToolChangeContext(None, NONE, reason=why_unknown(said) or f"{said.name} is neither true nor false")
