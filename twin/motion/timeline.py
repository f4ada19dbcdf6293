"""When everything happens: stretches and events one after the other, with a spindle that takes its time.

The spindle ramps from its speed to the commanded one at a constant rate α up to its base speed ω_b, and at α ω_b / ω above it,
where its power is constant. That is even in the odd function τ(ω) = ω up to ω_b, ω_b + (ω² − ω_b²) / (2 ω_b) above it, so that
a ramp takes |Δτ| / α. Meanwhile the axes go on in rapid; a cutting move that would begin before the speed is there waits
(spindle speed arrival). On a control whose M3 ends only with that arrival the rapids of later blocks wait too (`rapid_waits`);
those of its own block don't. A tool change stops the spindle first, and a program stop waits for a spindle that is on its way.
A dwell and a tool change take their time, and so does every halt: the control waits until the axes are in position.
"""

import numpy as np
from numpy.typing import NDArray

from twin.kernels.compiling import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
DWELL, TOOL_CHANGE, SPINDLE, PROGRAM_STOP, ORIENT = 0, 1, 2, 3, 6
RAPID = 0


@kernel
def effort(rpm: float, base_rpm: float) -> float:
    """τ(ω): what a ramp goes through evenly. With ω_b = 2000, 4000 rev/min cost 2000 + (16 − 4) 10⁶ / 4000 = 5000."""
    size = abs(rpm)
    if size > base_rpm:
        size = base_rpm + (size * size - base_rpm * base_rpm) / (2.0 * base_rpm)
    return size if rpm >= 0.0 else -size


@kernel
def timeline(
    first: Ints,
    seconds: Floats,
    leaving: Floats,
    kind: Ints,
    event_segment: Ints,
    event_kind: Ints,
    event_value: Floats,
    event_line: Ints,
    segment_line: Ints,
    tool_change_s: float,
    spindle_rpm_s: float,
    stopping_rpm_s: float,
    base_rpm: float,
    rapid_waits: bool,
    in_position_s: float,
) -> tuple[Floats, Floats, Floats, Floats, Floats, float]:
    """Start of each stretch (m) and its wait before that (m), start and seconds of each event (e), spindle ramps (r, 4), total.

    `leaving` (m) is the speed at the end of each stretch. A row of the ramps is: when it begins, when it ends, speed before and
    after (rev/min, signed by direction).
    """
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
        now += seconds[i] + (in_position_s if leaving[i] == 0.0 else 0.0)
    return start, wait, event_start, event_seconds, ramps[:r].copy(), now
