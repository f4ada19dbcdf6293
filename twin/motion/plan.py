"""The plan of a program: the speed along every segment and the time of every event.

`twin.motion.sampling` turns it into the reference of every tick.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.errors import PartProgramError
from twin.kernels.compiling import kernel
from twin.machine import Program
from twin.motion.limits import Bounds, Limits, bounds
from twin.motion.look_ahead import Stretches, stretches_with_times
from twin.motion.path import Kind, Path
from twin.motion.s_curve import along_profile, ramp_time, time_at_distance
from twin.motion.timeline import control_times, event_rows, timeline

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Override = float | Floats
"""A ratio (1 = 100 %), for the whole path or one for each segment."""


@dataclass(frozen=True, slots=True)
class Plan:
    """When and how fast. Rows of `*_segment` arrays belong to segments, of `event_*` to the events of the path.

    offset_mm: (n,) where each segment begins in its stretch
    stretch_start_s: (m,) of each stretch; wait_s: (m,) standing for the spindle before
    halt_s: (m,) standing at its end until the axes are in position
    start_s, duration_s: (n,) of each segment; entry_mm_s, peak_mm_s, exit_mm_s: (n,) its speeds
    event_start_s, event_duration_s: (e,)
    spindle_ramps: (r, 4) begin and end in s, speed before and after in rev/min, negative = M4
    total_s: until everything has ended
    """

    path: Path
    stretches: Stretches
    offset_mm: Floats
    stretch_start_s: Floats
    wait_s: Floats
    halt_s: Floats
    start_s: Floats
    duration_s: Floats
    entry_mm_s: Floats
    peak_mm_s: Floats
    exit_mm_s: Floats
    event_start_s: Floats
    event_duration_s: Floats
    spindle_ramps: Floats
    spindle_base_rpm: float
    total_s: float

    def seconds_by_line(self) -> Floats:
        """Seconds (highest line + 1,) spent on each source line: its segments, waits and events. Their sum is total_s."""
        line, first = self.path.line, self.stretches.first
        events = np.array([event.line for event in self.path.events], dtype=np.int64)
        lines = np.concatenate([line, line[first[:-1]], line[first[1:] - 1], events])
        each = np.concatenate([self.duration_s, self.wait_s, self.halt_s, self.event_duration_s])
        return np.asarray(np.bincount(lines, each), dtype=np.float64)

    def waits_by_line(self) -> Floats:
        """Seconds (highest line + 1,) that the axes stand for the spindle before each source line; part of `seconds_by_line`."""
        first_line = self.path.line[self.stretches.first[:-1]]
        return np.asarray(np.bincount(first_line, self.wait_s), dtype=np.float64)


def plan(path: Path, times: Program | Limits, feed_override: Override = 1.0, rapid_override: Override = 1.0) -> Plan:
    """The plan of `path` under the limits `times`. Overrides act on the programmed feed and the rapid rate, on no other limit.

    Raises PartProgramError where a cutting move has no feed, MachineError where the limits are for another number of axes.

    1200 mm at 6000 mm/min with 1000 mm/s² take 12 s and another v/a = 0.1 s to start and stop:

    >>> from twin.programs.canonical import Linear
    >>> from twin.motion.path import path_from_moves
    >>> line = path_from_moves([Linear(0, (1200.0, 0.0, 0.0), 6000.0, None)])
    >>> round(plan(line, Limits(rapid_mm_min=10000.0, acceleration_mm_s2=1000.0)).total_s, 9)
    12.1
    """
    limits = Limits.of(times) if isinstance(times, Program) else times
    allowed = bounds(path, limits)
    cap = speed_caps(path, allowed, path.feed_mm_min, feed_override, rapid_override)
    made = stretches_with_times(cap, allowed.acceleration_mm_s2, allowed.jerk_mm_s3, allowed.junction_mm_s, path.length_mm)
    when = timeline(made, path.segments(), event_rows(path.events), control_times(limits))
    offset = _offsets(made.first, path.length_mm)
    halt = np.where(made.speed_mm_s[1:] == 0.0, limits.in_position_s, 0.0)
    return Plan(
        path,
        made,
        offset,
        when.start_s,
        when.wait_s,
        halt,
        *_by_segment(made, when.start_s, offset, path.length_mm),
        when.event_start_s,
        when.event_duration_s,
        when.spindle_ramps,
        limits.spindle_base_rpm,
        float(when.total_s),
    )


def speed_caps(path: Path, allowed: Bounds, feed_mm_min: Floats, feed_override: Override, rapid_override: Override) -> Floats:
    """Highest speed (…, n) of each segment, mm/s."""
    rapid = path.kind == Kind.RAPID
    wanted = np.where(rapid, np.inf, feed_mm_min * feed_override / 60.0)
    fastest = np.minimum(wanted, allowed.speed_mm_s * np.where(rapid, rapid_override, 1.0))
    if not np.all(fastest > 0.0):
        k = int(np.argmin(np.min(np.atleast_2d(fastest), axis=0)))
        given = f"the feed at segment {k} is {feed_mm_min[..., k]} mm/min and the overrides leave nothing of it"
        raise PartProgramError(int(path.line[k]) + 1, "F", f"{given}; a cutting move needs a feed above 0")
    return np.ascontiguousarray(fastest)


@kernel
def _offsets(first: Ints, length: Floats) -> Floats:
    offset = np.zeros(len(length))
    for i in range(len(first) - 1):
        for k in range(first[i] + 1, first[i + 1]):
            offset[k] = offset[k - 1] + length[k - 1]
    return offset


@kernel
def _by_segment(
    stretches: Stretches, start: Floats, offset: Floats, length: Floats
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Start, duration, entry, peak and exit speed (n) of each segment, read off the profile of its stretch."""
    first, total, a, j, v, peak, seconds = stretches
    n = len(length)
    begin, duration, entry, top, leave = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for i in range(len(first) - 1):
        t, speed = 0.0, v[i]
        up, down = ramp_time(v[i], peak[i], a[i], j[i]), seconds[i] - ramp_time(peak[i], v[i + 1], a[i], j[i])
        for k in range(first[i], first[i + 1]):
            end, end_speed = seconds[i], v[i + 1]
            if k + 1 < first[i + 1]:
                end = time_at_distance(offset[k + 1], v[i], peak[i], v[i + 1], total[i], a[i], j[i])
                _s, end_speed, _a = along_profile(end, v[i], peak[i], v[i + 1], total[i], a[i], j[i])
            begin[k], duration[k], entry[k], leave[k] = start[i] + t, end - t, speed, end_speed
            top[k] = peak[i] if t <= down and end >= up else max(speed, end_speed)
            t, speed = end, end_speed
    return begin, duration, entry, top, leave


@kernel
def segment_times(stretches: Stretches, length: Floats) -> Floats:
    """Seconds (n,) on each segment."""
    first, total, a, j, v, peak, seconds = stretches
    duration = np.empty(len(length))
    for i in range(len(first) - 1):
        t, done = 0.0, 0.0
        for k in range(first[i], first[i + 1]):
            done += length[k]
            end = seconds[i]
            if k + 1 < first[i + 1]:
                end = time_at_distance(done, v[i], peak[i], v[i + 1], total[i], a[i], j[i])
            duration[k], t = end - t, end
    return duration
