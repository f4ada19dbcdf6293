"""When everything happens: stretches and events one after the other, with a spindle that takes its time.

The spindle ramps from its speed to the commanded one at a constant rate α up to its base speed ω_b, and at α ω_b / ω above it,
where its power is constant. That is even in the odd function τ(ω) = ω up to ω_b, ω_b + (ω² − ω_b²) / (2 ω_b) above it, so that
a ramp takes |Δτ| / α. Meanwhile the axes go on in rapid; a cutting move that would begin before the speed is there waits
(spindle speed arrival). On a control whose M3 ends only with that arrival the rapids of later blocks wait too (`rapid_waits`);
those of its own block don't. A tool change stops the spindle first, and a program stop waits for a spindle that is on its way.
A dwell and a tool change take their time, and so does every halt: the control waits until the axes are in position.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.kernels.compiling import kernel
from twin.motion.geometry import Segments
from twin.motion.limits import Limits
from twin.motion.look_ahead import Stretches
from twin.motion.path import Event

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
DWELL, TOOL_CHANGE, SPINDLE, PROGRAM_STOP, ORIENT = 0, 1, 2, 3, 6
RAPID = 0


class EventRows(NamedTuple):
    """The events of a path, each (e,): the segment that it comes before, its kind, its value and its source line."""

    segment: Ints
    kind: Ints
    value: Floats
    line: Ints


class ControlTimes(NamedTuple):
    """The times that the control and its spindle take. Ramps of the spindle in rev/min a second."""

    tool_change_s: float
    spindle_rpm_s: float
    stopping_rpm_s: float
    base_rpm: float
    in_position_s: float
    rapid_waits: bool


class Timeline(NamedTuple):
    """When everything happens, s.

    start_s, wait_s: (m,) of each stretch, and for how long it waited for the spindle before
    event_start_s, event_duration_s: (e,)
    spindle_ramps: (r, 4) begin and end, speed before and after in rev/min, negative = M4
    """

    start_s: Floats
    wait_s: Floats
    event_start_s: Floats
    event_duration_s: Floats
    spindle_ramps: Floats
    total_s: float


def event_rows(events: Sequence[Event]) -> EventRows:
    """Return the events as the kernels take them."""
    return EventRows(
        np.array([event.segment for event in events], dtype=np.int64),
        np.array([event.kind for event in events], dtype=np.int64),
        np.array([event.value for event in events], dtype=np.float64),
        np.array([event.line for event in events], dtype=np.int64),
    )


def control_times(limits: Limits) -> ControlTimes:
    """Return what the limits state; a spindle stops as it runs up where they do not say."""
    up, down = limits.spindle_acceleration_rpm_s, limits.spindle_deceleration_rpm_s
    return ControlTimes(
        float(limits.tool_change_s),
        float(up),
        float(up if down is None else down),
        float(limits.spindle_base_rpm),
        float(limits.in_position_s),
        bool(limits.rapid_waits_for_spindle),
    )


@kernel
def effort(rpm: float, base_rpm: float) -> float:
    """τ(ω): what a ramp goes through evenly. With ω_b = 2000, 4000 rev/min cost 2000 + (16 − 4) 10⁶ / 4000 = 5000."""
    size = abs(rpm)
    if size > base_rpm:
        size = base_rpm + (size * size - base_rpm * base_rpm) / (2.0 * base_rpm)
    return size if rpm >= 0.0 else -size


@kernel
def timeline(stretches: Stretches, segments: Segments, events: EventRows, control: ControlTimes) -> Timeline:
    """Return when each stretch, event and spindle ramp happens."""
    first, seconds, speed = stretches.first, stretches.seconds, stretches.speed_mm_s
    kind, segment_line = segments.kind, segments.line
    event_segment, event_kind, event_value, event_line = events
    tool_change_s, spindle_rpm_s, stopping_rpm_s, base_rpm, in_position_s, rapid_waits = control
    m, e = len(seconds), len(event_segment)
    start, wait = np.empty(m), np.zeros(m)
    event_start, event_seconds = np.empty(e), np.zeros(e)
    ramps = np.zeros((e, 4))
    now, rpm, ready, r, at, spindle_line = 0.0, 0.0, 0.0, 0, 0, -1
    for i in range(m + 1):
        here = first[i]
        while at < e and event_segment[at] <= here:
            what = event_kind[at]
            event_start[at] = now
            if what in (SPINDLE, TOOL_CHANGE, ORIENT):
                aim = event_value[at] if what == SPINDLE else 0.0
                if aim != rpm:
                    begin = max(now, ready)
                    rate = spindle_rpm_s if abs(aim) > abs(rpm) else stopping_rpm_s
                    ready = begin + abs(effort(aim, base_rpm) - effort(rpm, base_rpm)) / rate
                    ramps[r] = np.array([begin, ready, rpm, aim])
                    rpm, r, spindle_line = aim, r + 1, event_line[at]
            if what == DWELL:
                event_seconds[at] = event_value[at]
            elif what == TOOL_CHANGE:
                event_seconds[at] = max(ready - now, 0.0) + tool_change_s
            elif what in (ORIENT, PROGRAM_STOP):
                event_seconds[at] = max(ready - now, 0.0)
            now += event_seconds[at]
            at += 1
        if i == m:
            break
        waits = kind[here] != RAPID or (rapid_waits and rpm != 0.0 and segment_line[here] != spindle_line)
        if waits and ready > now:
            wait[i] = ready - now
            now = ready
        start[i] = now
        now += seconds[i] + (in_position_s if speed[i + 1] == 0.0 else 0.0)
    return Timeline(start, wait, event_start, event_seconds, ramps[:r].copy(), now)
