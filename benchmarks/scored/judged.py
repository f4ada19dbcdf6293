"""The outcome for one machine: what was found of its faults and when, which alerts were none, and what happened at the time.

An occasion is no fault: an override turned by hand, a new program, the first part of a batch, a Monday's start, a disturbance
that all feel. An alert within one is a false alert like any other, and counted by occasion.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.evaluation.events import Detections, Event, detections
from benchmarks.evaluation.range_based import Range, ranges
from benchmarks.evaluation.volume import vus_pr
from benchmarks.simulated_cell.cell import Cell
from benchmarks.simulated_cell.fault import Fault, FaultKind
from benchmarks.simulated_cell.schedule import DAY_S, KNOWN_PROGRAMS, SHIFTS_S, Part
from twin.anomaly.alarm import AlarmRule, is_alarm, onsets
from twin.anomaly.errors import ModelError
from twin.anomaly.threshold import fit_threshold

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
DWELL, CLEAR, CALM_S = 3, 0.8, 600.0
GRACE_S, WAKE_S = 60.0, 300.0
FRAME_S = 10
VOLUME_BUFFER, VOLUME_STEPS = 60, 3
MONDAY_S = (SHIFTS_S[0], SHIFTS_S[0] + 2 * 3600)
OCCASIONS = (
    *("override by hand", "new program, first part", "new program, second part", "new program, later"),
    *("first part of a batch", "Monday's start", "disturbance", "none of these"),
)


class Context(NamedTuple):
    """The part in which a fault begins: is its program new, and how many of its parts came before."""

    is_new: bool
    number: int


@dataclass(frozen=True)
class Judged:
    """Alarm ranges and fault ranges in frames of 10 s; faults and contexts in order; false alerts by occasion."""

    detections: Detections
    alarms: Sequence[Range]
    events: Sequence[Range]
    vus: float
    faults: Sequence[Fault]
    contexts: Sequence[Context]
    false: Sequence[str]
    has_threshold: bool

    def of(self, wanted: Callable[[Fault], bool], context: Callable[[Context], bool] = lambda _: True) -> Detections:
        """Return the detections of some faults only."""
        rows = zip(self.detections.delays_s, self.faults, self.contexts, strict=True)
        return Detections(tuple(delay for delay, fault, where in rows if wanted(fault) and context(where)), 0, 0.0)


def threshold_of(scores: Floats, idle: Flags, tick_s: float, alerts_per_week: float) -> float | None:
    """The threshold fitted on scores of a week without faults; None where none can be."""
    try:
        return fit_threshold([scores], [idle], tick_s, DWELL, CLEAR, alerts_per_week, round(CALM_S / tick_s)).threshold
    except ModelError:
        return None


def rule_of(threshold: float | None, tick_s: float) -> AlarmRule | None:
    """Return the rule of the alarm, as the processor has it; None without a threshold."""
    return None if threshold is None else AlarmRule(threshold, DWELL, CLEAR, round(CALM_S / tick_s))


def alarms_of(threshold: float | None, scores: Floats, idle: Flags, tick_s: float) -> Flags:
    """Return the ticks at which the alarm is on."""
    rule = rule_of(threshold, tick_s)
    return np.zeros(len(scores), dtype=np.bool_) if rule is None else is_alarm(rule, scores, idle)


def outcome(
    cell: Cell, place: int, from_s: int, tick_s: int, *, scores: Floats, idle: Flags, on: Flags, has_threshold: bool
) -> Judged:
    """Return the outcome of a machine from `from_s` on. scores, idle (do not count), on (alarms): (T,), each tick_s."""
    faults = [fault for fault in cell.faults if fault.machine == place]
    events = [Event(fault.start_s - from_s, fault.end_s - from_s) for fault in faults]
    alerts_s = [float(tick * tick_s) for tick in onsets(on)]
    found = detections(events, alerts_s, len(on) * float(tick_s), GRACE_S, WAKE_S)
    false_s = [at for at in alerts_s if not any(one.start_s <= at <= one.end_s + max(GRACE_S, WAKE_S) for one in events)]
    framed, on_frames = _frames(np.where(idle | np.isnan(scores), -np.inf, scores), tick_s), _frames(on, tick_s)
    lowest = float(framed[np.isfinite(framed)].min()) if np.isfinite(framed).any() else 0.0
    spans = [Range(int(event.start_s) // FRAME_S, int(event.end_s) // FRAME_S + 1) for event in events]
    volume = vus_pr(np.maximum(framed, lowest), spans, VOLUME_BUFFER, steps=VOLUME_STEPS)
    parts = cell.schedules[place].parts
    return Judged(
        found,
        ranges(on_frames.tolist()),
        spans,
        volume,
        faults,
        [_context(parts, fault.start_s) for fault in faults],
        [occasion(cell, place, from_s + at) for at in false_s],
        has_threshold,
    )


def _frames(values: NDArray[np.generic], tick_s: int) -> NDArray[np.generic]:
    """The largest of each frame."""
    each = FRAME_S // tick_s
    return values[: len(values) // each * each].reshape(-1, each).max(axis=1)


def _part(parts: Sequence[Part], at_s: float) -> Part | None:
    return next((part for part in parts if part.start_s <= at_s < part.end_s), None)


def _context(parts: Sequence[Part], at_s: float) -> Context:
    part = _part(parts, at_s)
    return Context(part.program == KNOWN_PROGRAMS, part.number) if part else Context(False, -1)


def occasion(cell: Cell, place: int, at_s: float) -> str:
    """Name what happened on a machine at a time that is no fault."""
    schedule = cell.schedules[place]
    part = _part(schedule.parts, at_s)
    if any(start - 30.0 <= at_s <= end + WAKE_S for start, end in schedule.hands_s):
        return OCCASIONS[0]
    if part is not None and part.program == KNOWN_PROGRAMS:
        return OCCASIONS[1 + min(part.number, 2)]
    if part is not None and part.is_first:
        return OCCASIONS[4]
    if at_s // DAY_S % 7 == 0 and MONDAY_S[0] <= at_s % DAY_S < MONDAY_S[1]:
        return OCCASIONS[5]
    if any(one.start_s + one.delays_s[place] <= at_s <= one.start_s + one.lasts_s + WAKE_S for one in cell.disturbances):
        return OCCASIONS[6]
    return OCCASIONS[7]


def is_kind(kind: FaultKind, size: float | None = None) -> Callable[[Fault], bool]:
    """Return a test for faults of a kind, and of a size where it is given."""
    return lambda fault: fault.kind is kind and size in (None, fault.size)
