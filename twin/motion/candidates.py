"""One path under many feeds and speeds: seconds and wear of each candidate, compiled, nothing sampled.

Everything that neither feed nor speed changes is worked out once. A candidate brings the feed of each segment and the value of
each spindle event. Some of these events are optional: where the speed is already the one that is asked for, the block is
none, and the axes do not stop for it.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.kernels.compiling import kernel
from twin.motion.geometry import Segments
from twin.motion.limits import Bounds, Limits, bounds
from twin.motion.look_ahead import stretches_with_times
from twin.motion.path import Event, Path
from twin.motion.plan import segment_times, speed_caps
from twin.motion.timeline import ControlTimes, EventRows, control_times, event_rows, timeline

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
SPINDLE = 2


class Wear(NamedTuple):
    """The wear of the tool: `factor` |n|^exponent a second at n rev/min.

    factor: (segments,) on a segment, 0 = nothing is cut there
    share: (segments,) part of all the time that nothing is cut which wears the tool as this segment does; 0 = that time does not
    """

    factor: Floats
    share: Floats
    exponent: float


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """A path made ready. `optional`: events beyond those of the path, in order of their segments, that change the speed.

    events: of the path and the optional ones, as `seconds_and_wear` wants their values; is_optional: (events,)
    """

    path: Path
    limits: Limits
    allowed: Bounds
    events: tuple[Event, ...]
    is_optional: Flags
    feed_ratio: float
    rapid_ratio: float

    @classmethod
    def of(
        cls, path: Path, limits: Limits, optional: tuple[Event, ...] = (), feed_ratio: float = 1.0, rapid_ratio: float = 1.0
    ) -> "Candidates":
        """Made ready under the limits. An optional event comes after those of the path before the same segment."""
        marked = [(event.segment, 0, k, event) for k, event in enumerate(path.events)]
        marked += [(event.segment, 1, k, event) for k, event in enumerate(optional)]
        marked.sort(key=lambda one: one[:3])
        flags = np.array([bool(kind) for _, kind, _, _ in marked], dtype=np.bool_)
        events = tuple(event for *_, event in marked)
        return cls(path, limits, bounds(path, limits), events, flags, feed_ratio, rapid_ratio)

    def seconds_and_wear(self, feed_mm_min: Floats, event_value: Floats, wear: Wear | None = None) -> tuple[Floats, Floats]:
        """Seconds (candidates,), and the part of a tool's life that the program takes (candidates,).

        feed_mm_min: (candidates, segments), of any value on rapids; event_value: (candidates, events), as `events` has them

        Raises PartProgramError where a feed is none.
        """
        caps = speed_caps(self.path, self.allowed, np.atleast_2d(feed_mm_min), self.feed_ratio, self.rapid_ratio)
        return _evaluated(
            caps,
            np.ascontiguousarray(np.atleast_2d(event_value)),
            self.allowed,
            self.path.segments(),
            event_rows(self.events),
            self.is_optional,
            control_times(self.limits),
            wear or no_wear(len(self.path)),
            wear is not None,
        )


def no_wear(segments: int) -> Wear:
    """A tool that never wears."""
    return Wear(np.zeros(segments), np.zeros(segments), 1.0)


@kernel
def _evaluated(
    caps: Floats,
    event_value: Floats,
    allowed: Bounds,
    segments: Segments,
    events: EventRows,
    optional: Flags,
    control: ControlTimes,
    wear: Wear,
    wears: bool,
) -> tuple[Floats, Floats]:
    """Return seconds and wear of each candidate; the values of `events` are those of the path, `event_value` the candidates'."""
    _speed, acceleration, jerk, junction = allowed
    event_segment, event_kind, _value, event_line = events
    count, length = len(caps), segments.length_mm
    totals, worn = np.empty(count), np.zeros(count)
    for c in range(count):
        value, meets, keep, kept = event_value[c].copy(), junction.copy(), np.empty(len(optional), dtype=np.int64), 0
        rpm = 0.0
        for e in range(len(optional)):
            if optional[e]:
                if value[e] == rpm:
                    continue
                meets[event_segment[e]] = 0.0
            if event_kind[e] == SPINDLE:
                rpm = value[e]
            keep[kept] = e
            kept += 1
        mine = keep[:kept]
        made = stretches_with_times(caps[c], acceleration, jerk, meets, length)
        happening = EventRows(event_segment[mine], event_kind[mine], value[mine], event_line[mine])
        totals[c] = timeline(made, segments, happening, control).total_s
        if wears:
            worn[c] = _worn(happening, segment_times(made, length), totals[c], wear)
    return totals, worn


@kernel
def _worn(events: EventRows, moving: Floats, total_s: float, wear: Wear) -> float:
    """The sum of factor · |n|^exponent · seconds, n the speed that is commanded, and what the rest of the time takes."""
    event_segment, event_kind, value, _line = events
    factor, share, exponent = wear
    worn, rate, cutting_s, power, at = 0.0, 0.0, 0.0, 0.0, 0
    for k in range(len(moving)):
        while at < len(event_segment) and event_segment[at] <= k:
            if event_kind[at] == SPINDLE:
                power = abs(value[at]) ** exponent
            at += 1
        if factor[k] > 0.0:
            worn += moving[k] * factor[k] * power
            rate += share[k] * factor[k] * power
            cutting_s += moving[k]
    return worn + (total_s - cutting_s) * rate
