"""The conditions of a moment and their age: the spindle's speed, the feed, the tool change, the heat. From it come the regimes.

Regimes come from what the machine is told to do, as far as it is known, not from the signal that is judged: else a gap would move
its own samples into another regime.
"""

import math
from dataclasses import dataclass, replace
from enum import StrEnum

from processors.description import in_words
from processors.sample import Sample, SampleKind
from processors.tool_change_detector.context import ACTIVE as CHANGE
from processors.tool_change_detector.context import DETECTED, STALE, tool_change_context
from processors.tool_change_detector.context import NONE as NOBODY
from twin.vocabulary import twin_signals

SPEED, FEED = "spindle_rpm", "feed_mm_min"
RISE, HEAT_BASIS = twin_signals.SPINDLE_TEMP_RISE_K, twin_signals.SPINDLE_TEMP_BASIS
CHANGE_SOURCE = "tool_change_source"
EXECUTION, PROGRAM = "exec_state", "program"
TURNING_RPM_MIN, FEED_MM_MIN_MIN = 50.0, 1.0
SPEED_CHANGE = 0.02
HEATING_S = 1200.0
"""The modelled rise is compared with its own mean over such a time."""
GAP_MAX = 1e5
PROGRAM_CHARACTERS_MAX = 40


_DATA, _HOLE = SampleKind.DATA, SampleKind.HOLE
_CHANGES = frozenset({CHANGE, DETECTED, CHANGE_SOURCE})


class Feeding(StrEnum):
    """The cut as the feed shows it."""

    UNKNOWN = "unknown"
    REST = "rest"
    FEED = "feed"
    RAPID = "rapid"


class ToolChange(StrEnum):
    """The tool change as the control reports it."""

    ABSENT = "absent"  # it says nothing, ever
    UNKNOWN = "unknown"  # it says nothing now
    NONE = "none"
    ACTIVE = "active"


_UNKNOWN, _REST, _FEED, _RAPID = Feeding.UNKNOWN, Feeding.REST, Feeding.FEED, Feeding.RAPID


@dataclass(frozen=True, slots=True)
class Watch:
    """The conditions that have to hold for a while. A new one only where something changed.

    rise_mean_k: of the modelled rise, over HEATING_S
    """

    rpm: float | None = None
    rpm_since_s: float = 0.0
    feeding: Feeding = Feeding.UNKNOWN
    feeding_since_s: float = 0.0
    change: ToolChange = ToolChange.ABSENT
    change_since_s: float = 0.0
    rise_mean_k: float | None = None


def watched(watch: Watch, rapid_feed_mm_min: float, sample: Sample) -> Watch:
    """The watch after a sample of any kind."""
    at_s = sample.at_s
    if sample.kind is _HOLE:  # what happened meanwhile is not known
        return replace(watch, rpm_since_s=at_s, feeding_since_s=at_s, change_since_s=at_s)
    (rpm, _), known = sample.number(SPEED), watch.rpm
    is_same_speed = rpm == known or not (rpm is None or known is None or _is_another_speed(rpm, known))
    feeding, change = _feeding(rapid_feed_mm_min, sample), watch.change
    if sample.kind is not _DATA or not _CHANGES.isdisjoint(sample.changed):
        change = _change(sample)
    is_same_feeding, is_same_change = feeding is watch.feeding, change is watch.change
    if is_same_speed and is_same_feeding and is_same_change:
        return watch
    return Watch(
        known if is_same_speed else rpm, watch.rpm_since_s if is_same_speed else at_s,
        feeding, watch.feeding_since_s if is_same_feeding else at_s,
        change, watch.change_since_s if is_same_change else at_s,
        watch.rise_mean_k,
    )  # fmt: skip


def _is_another_speed(rpm: float, known: float) -> bool:
    """Return True if the speed has changed by more than it wavers."""
    step = abs(rpm - known)
    return step > TURNING_RPM_MIN / 2 and step > SPEED_CHANGE * abs(known)


def is_heat_of(version: str, sample: Sample) -> bool:
    """Return True if what processor thermal says is of this description. Where one is promoted, or a challenger begins, it is a
    moment behind; then what the row holds is still of the one before. What says nothing of a description is believed."""
    basis = sample.row.get(HEAT_BASIS)
    return not version or basis is None or not isinstance(basis.value, str) or in_words(version) in basis.value


def heated(watch: Watch, version: str, sample: Sample, seconds: float) -> Watch:
    """The watch with the modelled rise of this description held for `seconds` more."""
    if not is_heat_of(version, sample):
        return watch
    rise_k, _ = sample.number(RISE)
    if rise_k is None or abs(rise_k) > GAP_MAX:
        return watch if watch.rise_mean_k is None else replace(watch, rise_mean_k=None)
    if watch.rise_mean_k is not None:
        gain = 1.0 - math.exp(-seconds / HEATING_S)
        rise_k = watch.rise_mean_k + gain * (rise_k - watch.rise_mean_k)
    # Spelled out, since `replace` looks up each field.
    return Watch(
        watch.rpm, watch.rpm_since_s, watch.feeding, watch.feeding_since_s, watch.change, watch.change_since_s, rise_k
    )  # fmt: skip


def _feeding(rapid_feed_mm_min: float, sample: Sample) -> Feeding:
    feed_mm_min, _ = sample.number(FEED)
    if feed_mm_min is None:
        return _UNKNOWN
    if abs(feed_mm_min) < FEED_MM_MIN_MIN:
        return _REST
    return _FEED if abs(feed_mm_min) < rapid_feed_mm_min else _RAPID


def _change(sample: Sample) -> ToolChange:
    """Return the report of the control, else of the detector; ABSENT where neither does."""
    said = tool_change_context(sample.row)
    if said.active is not None and said.source != STALE:
        return ToolChange.ACTIVE if said.active else ToolChange.NONE
    control, detected, source = sample.row.get(CHANGE), sample.row.get(DETECTED), sample.row.get(CHANGE_SOURCE)
    if detected is None and (control is None or (source is not None and source.value == NOBODY)):
        return ToolChange.ABSENT
    return ToolChange.UNKNOWN
