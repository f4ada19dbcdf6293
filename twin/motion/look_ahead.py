"""The look-ahead over a whole program: which segments run as one stretch, and how fast each begins, peaks and ends.

Acceleration is 0 where stretches meet. At its ends a stretch has the speed that the corner allows, and that a ramp can reach
from the stretch before (forward pass) and shed before the one after (backward pass). With every segment a stretch of its own
this is the fastest profile there is for the trapezoid (j = ∞). Under a jerk limit it would waste time in a contour of short
blocks, where the ramp is longer than the blocks: segments with one feed are therefore joined wherever the first plan is below
both that feed and what the corner between them allows, as long as the joined plan keeps to the corner too. Every limit holds;
the fastest is nearly reached.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.kernels.compiling import kernel
from twin.motion.s_curve import along_profile, peak_speed, profile_time, reachable_speed, time_at_distance

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
JOININGS_MAX = 12
"""Rounds of joining; in practice two to five. If some corner were still passed too fast then, the plan without joining stands."""
HAIR = 1e-9


class Stretches(NamedTuple):
    """Profiles, one row a stretch (m): ramp, cruise and ramp over consecutive segments. mm, mm/s, s.

    first: (m + 1,) first segment of each, then the number of segments
    speed_mm_s: (m + 1,) at the start of each and at the end of the last
    """

    first: Ints
    length_mm: Floats
    acceleration_mm_s2: Floats
    jerk_mm_s3: Floats
    speed_mm_s: Floats
    peak_mm_s: Floats
    seconds: Floats


@kernel
def stretches(
    cap: Floats, acceleration: Floats, jerk: Floats, junction: Floats, length: Floats, joined: Flags
) -> tuple[Ints, Floats, Floats, Floats]:
    """First segment of each stretch (m + 1, the last being their number), and length, acceleration and jerk of each (m).

    joined: (n + 1,) where a segment goes on with the stretch of the one before it
    """
    n = len(cap)
    first = np.empty(n + 1, dtype=np.int64)
    total, least_a, least_j = np.empty(n), np.empty(n), np.empty(n)
    m = 0
    for k in range(n):
        if joined[k]:
            total[m - 1] += length[k]
            least_a[m - 1] = min(least_a[m - 1], acceleration[k])
            least_j[m - 1] = min(least_j[m - 1], jerk[k])
        else:
            first[m], total[m], least_a[m], least_j[m] = k, length[k], acceleration[k], jerk[k]
            m += 1
    first[m] = n
    return first[: m + 1].copy(), total[:m].copy(), least_a[:m].copy(), least_j[:m].copy()


@kernel
def end_speeds(cap: Floats, junction: Floats, first: Ints, length: Floats, a: Floats, j: Floats) -> Floats:
    """Speeds (m + 1) at the ends of the stretches, mm/s: the forward and the backward pass."""
    m = len(length)
    v = np.empty(m + 1)
    v[0] = 0.0
    for i in range(1, m):
        v[i] = min(junction[first[i]], cap[first[i]], cap[first[i - 1]])
    v[m] = 0.0
    for i in range(m):
        if v[i + 1] > v[i]:
            v[i + 1] = min(v[i + 1], reachable_speed(v[i], length[i], a[i], j[i]))
    for i in range(m - 1, -1, -1):
        if v[i] > v[i + 1]:
            v[i] = min(v[i], reachable_speed(v[i + 1], length[i], a[i], j[i]))
    return v


@kernel
def peaks_and_times(cap: Floats, first: Ints, length: Floats, a: Floats, j: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Peak speed (m) and seconds (m) of each stretch."""
    m = len(length)
    peak, seconds = np.empty(m), np.empty(m)
    for i in range(m):
        peak[i] = peak_speed(v[i], v[i + 1], cap[first[i]], length[i], a[i], j[i])
        seconds[i] = profile_time(v[i], peak[i], v[i + 1], length[i], a[i], j[i])
    return peak, seconds


@kernel
def _part_where_too_fast(joined: Flags, junction: Floats, lengths: Floats, made: Stretches) -> int:
    """Take back each joining whose corner the plan passes too fast; how many."""
    first, total, a, j, v, peak, _seconds = made
    parted = 0
    for i in range(len(total)):
        s = 0.0
        for k in range(first[i] + 1, first[i + 1]):
            s += lengths[k - 1]
            if joined[k] and junction[k] < peak[i]:
                t = time_at_distance(s, v[i], peak[i], v[i + 1], total[i], a[i], j[i])
                _s, speed, _a = along_profile(t, v[i], peak[i], v[i + 1], total[i], a[i], j[i])
                if speed > junction[k] * (1.0 + HAIR):
                    joined[k] = False
                    parted += 1
    return parted


@kernel
def _profiles(cap: Floats, acceleration: Floats, jerk: Floats, junction: Floats, length: Floats, joined: Flags) -> Stretches:
    first, total, a, j = stretches(cap, acceleration, jerk, junction, length, joined)
    v = end_speeds(cap, junction, first, total, a, j)
    peak, seconds = peaks_and_times(cap, first, total, a, j, v)
    return Stretches(first, total, a, j, v, peak, seconds)


@kernel
def stretches_with_times(cap: Floats, acceleration: Floats, jerk: Floats, junction: Floats, length: Floats) -> Stretches:
    """Return the stretches of the fastest plan: joined where that is faster."""
    joined = np.zeros(len(cap) + 1, dtype=np.bool_)
    plain = _profiles(cap, acceleration, jerk, junction, length, joined)
    first, v = plain.first, plain.speed_mm_s
    for i in range(1, len(plain.length_mm)):
        k = first[i]
        joined[k] = jerk[k] < np.inf and cap[k] == cap[k - 1] and 0.0 < v[i] < min(junction[k], cap[k]) * (1.0 - HAIR)
    if not np.any(joined):
        return plain
    for _ in range(JOININGS_MAX):
        made = _profiles(cap, acceleration, jerk, junction, length, joined)
        if _part_where_too_fast(joined, junction, length, made) == 0:
            return plain if np.sum(made.seconds) > np.sum(plain.seconds) else made
    return plain
