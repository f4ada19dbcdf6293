"""Sampling of a plan: the motion at every tick of the servo loops.

The reference is the path at the distance that the profile has covered: continuous, and exact at the end of every stretch. With
`average_s` it goes through moving averages of those lengths after interpolation, the form in which many controls accelerate
(FANUC: linear acc/dec after cutting feed interpolation, then bell-shaped: two averages). An average shortens corners and arcs,
and reaches the end exactly, by the sum of the averages later; `line`, `segment`, `s_mm` and `feed_mm_min` then give what the
interpolator put out, not what is left of it.
"""

import numpy as np
from numpy.typing import NDArray

from twin.kernels.compiling import kernel
from twin.motion.look_ahead import Stretches
from twin.motion.motion import ExecState, Motion
from twin.motion.path import EventKind
from twin.motion.plan import Plan
from twin.motion.s_curve import along_profile
from twin.motion.timeline import effort

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def sampled(plan: Plan, period_s: float, average_s: tuple[float, ...] = ()) -> Motion:
    """The motion of `plan` every `period_s`; `average_s` are the lengths of the moving averages after interpolation."""
    path = plan.path
    windows = [max(1, round(length / period_s)) for length in average_s]
    ticks = int(np.ceil(plan.total_s / period_s - 1e-9)) + 1 + sum(window - 1 for window in windows)
    t: Floats = np.arange(ticks, dtype=np.float64) * np.float64(period_s)
    segment, s, speed = _places(t, plan.stretches, plan.stretch_start_s, plan.offset_mm, path.length_mm)
    reference = path.at(segment, s) if len(path) else np.zeros((ticks, len(path.axes)))
    for window in windows:
        reference = moving_average(reference, window)
    tool, changing = _tools(plan, t)
    rpm = _spindle(plan.spindle_ramps, plan.spindle_base_rpm, t)
    return Motion(
        axes=path.axes,
        t_s=t,
        reference_mm=reference,
        line=_lines(plan, t, segment),
        feed_mm_min=speed * 60.0,
        spindle_rpm=np.abs(rpm),
        spindle_direction=np.sign(rpm).astype(np.int64),
        tool_number=tool,
        tool_change_active=changing,
        segment=segment,
        s_mm=s,
        exec_state=np.where(t >= plan.total_s, ExecState.PROGRAM_COMPLETED, ExecState.ACTIVE).astype(np.int64),
    )


@kernel
def _places(
    t: Floats, stretches: Stretches, start: Floats, offset: Floats, segment_length: Floats
) -> tuple[Ints, Floats, Floats]:
    """Segment, distance in it and speed at each of the times `t`, which ascend. Between stretches the axes stand."""
    first, length, a, j, v, peak, _seconds = stretches
    n, m = len(t), len(length)
    segment, s, speed = np.zeros(n, dtype=np.int64), np.zeros(n), np.zeros(n)
    i, k = 0, 0
    if m == 0:
        return segment, s, speed
    for tick in range(n):
        while i + 1 < m and t[tick] >= start[i + 1]:
            i += 1
            k = first[i]
        if t[tick] < start[i]:
            continue
        done, speed[tick], _unused = along_profile(t[tick] - start[i], v[i], peak[i], v[i + 1], length[i], a[i], j[i])
        while k + 1 < first[i + 1] and done >= offset[k + 1]:
            k += 1
        segment[tick] = k
        s[tick] = segment_length[k] if done >= length[i] else min(done - offset[k], segment_length[k])
    return segment, s, speed


@kernel
def moving_average(values: Floats, window: int) -> Floats:
    """Mean (n, axes) of each value and the `window` − 1 before it; before the first one it stood there.

    It is summed again at each tick from the differences to the newest value, so that a value at rest comes out bit by bit as it
    is.
    """
    n, axes = values.shape
    mean = np.empty_like(values)
    for a in range(axes):
        for tick in range(n):
            newest, total = values[tick, a], 0.0
            for back in range(1, window):
                total += values[max(tick - back, 0), a] - newest
            mean[tick, a] = newest + total / window
    return mean


def _spindle(ramps: Floats, base_rpm: float, t: Floats) -> Floats:
    """Signed speed (n,) at the times `t`: even in the effort τ of `timeline`; above ω_b it is √(2 ω_b τ − ω_b²)."""
    if not len(ramps):
        return np.zeros(len(t))
    at = np.searchsorted(ramps[:, 0], t, side="right") - 1
    begin, end, before, after = ramps[np.maximum(at, 0)].T
    share = np.where(end > begin, np.clip((t - begin) / np.where(end > begin, end - begin, 1.0), 0.0, 1.0), 1.0)
    first, last = _effort(before, base_rpm), _effort(after, base_rpm)
    through = np.where(share < 1.0, first + (last - first) * share, last)
    size = np.abs(through)
    if np.isfinite(base_rpm):
        size = np.where(size > base_rpm, np.sqrt(np.maximum(2.0 * base_rpm * size - base_rpm**2, 0.0)), size)
    rpm = np.where(share < 1.0, np.sign(through) * size, after)
    return np.where(at >= 0, rpm, 0.0)


def _effort(rpm: Floats, base_rpm: float) -> Floats:
    return np.array([effort(float(one), base_rpm) for one in np.unique(rpm)])[np.unique(rpm, return_inverse=True)[1]]


def _tools(plan: Plan, t: Floats) -> tuple[Ints, NDArray[np.bool_]]:
    """Number of the tool (0 while none is in the spindle) and whether a change is in progress (n,)."""
    number, changing = np.zeros(len(t), dtype=np.int64), np.zeros(len(t), dtype=np.bool_)
    for k, event in enumerate(plan.path.events):
        if event.kind == EventKind.TOOL_CHANGE:
            begin, end = plan.event_start_s[k], plan.event_start_s[k] + plan.event_duration_s[k]
            number[t >= begin] = 0
            number[t >= end] = int(event.value)
            changing |= (t >= begin) & (t < end)
    return number, changing


def _with_waits(plan: Plan) -> Floats:
    """When the block of each segment (n,) begins: with its wait for the spindle, after all that happens before."""
    begun, wait = plan.start_s.copy(), plan.wait_s
    at = plan.stretches.first[:-1][wait > 0.0]
    event = np.searchsorted([event.segment for event in plan.path.events], at, side="right") - 1
    ended = plan.event_start_s[event] + plan.event_duration_s[event]
    begun[at] = np.maximum(begun[at] - wait[wait > 0.0], ended)
    return begun


def _lines(plan: Plan, t: Floats, segment: Ints) -> Ints:
    """The source line (n,) of what happens at each time: of the latest event or segment begun, waits included."""
    path = plan.path
    begun = np.concatenate([_with_waits(plan), plan.event_start_s])
    line = np.concatenate([path.line, np.array([event.line for event in path.events], dtype=np.int64)])
    rank = np.concatenate([np.arange(len(path)) * 2.0 + 1.0, np.array([event.segment * 2.0 for event in path.events])])
    if not len(begun):
        return np.zeros(len(t), dtype=np.int64)
    order = np.lexsort((rank, begun))
    at = np.searchsorted(begun[order], t, side="right") - 1
    return np.asarray(line[order][np.maximum(at, 0)], dtype=np.int64)
