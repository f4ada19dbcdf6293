"""The live twin beside the measurement, signal by signal, and the regime: twin minus measured at one moment.

| signal | regime | the twin |
|---|---|---|
| spindle_temp_c | warm_up, steady, cool_down, by the modelled heat | the thermal network, as processor `thermal` publishes it |
| spindle_load_pct | air: the spindle turns, no feed or a rapid one | idle power over rated power, if configured; else learned |
| spindle_load_pct | cutting, for each program | learned |
| spindle_rpm | turning | spindle_rpm_cmd |
| axis_{a}_load_pct | standstill: no feed, a program runs | learned |

Regimes come from what the machine is told to do, as far as it is known, not from the signal that is judged: else a gap would move
its own samples into another regime. Nothing is compared during a tool change and until settle_s after it; load, speed and axes
not until settle_s after a change of speed or feed either.
"""

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

from processors.sample import Sample, SampleKind
from processors.tool_change_detector.context import ACTIVE as CHANGE
from processors.tool_change_detector.context import DETECTED, STALE, tool_change_context
from processors.tool_change_detector.context import NONE as NOBODY
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals

SPEED, COMMAND, FEED = "spindle_rpm", "spindle_rpm_cmd", "feed_mm_min"
LOAD, TEMPERATURE = "spindle_load_pct", "spindle_temp_c"
RESIDUAL, RISE = twin_signals.SPINDLE_TEMP_RESIDUAL_K, twin_signals.SPINDLE_TEMP_RISE_K
CHANGE_SOURCE = "tool_change_source"
EXECUTION, PROGRAM = "exec_state", "program"
AXIS_LOADS = tuple(f"axis_{letter}_load_pct" for letter in "xyzabc")
SIGNALS = (TEMPERATURE, LOAD, SPEED, *AXIS_LOADS)
INPUTS = frozenset({SPEED, COMMAND, FEED, LOAD, RESIDUAL, RISE, CHANGE, DETECTED, CHANGE_SOURCE, EXECUTION, PROGRAM, *AXIS_LOADS})
REGIMES = {TEMPERATURE: ("warm_up", "steady", "cool_down"), LOAD: ("air", "cutting"), SPEED: ("turning",)}
REGIMES |= dict.fromkeys(AXIS_LOADS, ("standstill",))
UNITS = {TEMPERATURE: "K", LOAD: "%", SPEED: "rev/min"} | dict.fromkeys(AXIS_LOADS, "%")
RESOLUTIONS = {TEMPERATURE: 0.1, LOAD: 1.0, SPEED: 1.0} | dict.fromkeys(AXIS_LOADS, 1.0)
"""The rounding of what a control commonly shows; no floor is taken to be finer than that."""
TURNING_RPM_MIN, FEED_MM_MIN_MIN = 50.0, 1.0
SPEED_CHANGE = 0.02
HEATING_K, HEATING_S = 0.5, 1200.0
"""Warm-up: the modelled rise is so far above its own mean over such a time."""
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


class Given(NamedTuple):
    """The settings of the comparison. idle_load_pct: of the drive, None = not known."""

    settle_s: float
    rapid_feed_mm_min: float
    idle_load_pct: float | None


class Compared(NamedTuple):
    """Twin minus measured; where the baseline is learned, minus measured."""

    signal: str
    regime: str
    gap: float
    is_learned: bool


class Comparison(NamedTuple):
    """The comparisons of one moment, and by signal why there is none, where an input was missing."""

    compared: tuple[Compared, ...]
    missing: dict[str, str]
    is_left_out: bool


def watched(watch: Watch, given: Given, sample: Sample) -> Watch:
    """The watch after a sample of any kind."""
    at_s = sample.at_s
    if sample.kind is _HOLE:  # what happened meanwhile is not known
        return replace(watch, rpm_since_s=at_s, feeding_since_s=at_s, change_since_s=at_s)
    (rpm, _), known = sample.number(SPEED), watch.rpm
    is_same_speed = rpm == known or not (rpm is None or known is None or _is_another_speed(rpm, known))
    feeding, change = _feeding(given, sample), watch.change
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


def heated(watch: Watch, sample: Sample, seconds: float) -> Watch:
    """The watch with the modelled rise held for `seconds` more."""
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


def comparison(watch: Watch, given: Given, sample: Sample) -> Comparison:
    """Return the comparisons of this moment."""
    if watch.change is ToolChange.UNKNOWN:
        return Comparison((), dict.fromkeys(SIGNALS, f"{CHANGE} is not known: the samples cannot be gated"), True)
    found = [_temperature(watch, sample), _load(watch, given, sample), _speed(watch, given, sample)]
    found += [_at_rest(watch, given, sample, signal) for signal in AXIS_LOADS]
    missing = {signal: why for signal, why in zip(SIGNALS, found, strict=True) if isinstance(why, str)}
    is_gated = watch.change is ToolChange.ACTIVE or (
        watch.change is ToolChange.NONE and sample.at_s < watch.change_since_s + given.settle_s
    )
    if is_gated:
        return Comparison((), missing, True)
    compared = tuple(one for one in found if isinstance(one, Compared) and abs(one.gap) <= GAP_MAX)
    return Comparison(compared, missing, not compared)


def _temperature(watch: Watch, sample: Sample) -> Compared | str | None:
    residual_k, why = sample.number(RESIDUAL)
    rise_k, no_rise = sample.number(RISE)
    if residual_k is None or rise_k is None or watch.rise_mean_k is None:
        return why or no_rise or f"{RISE} is not known yet"
    heating_k = rise_k - watch.rise_mean_k
    regime = "warm_up" if heating_k > HEATING_K else "cool_down" if heating_k < -HEATING_K else "steady"
    return Compared(TEMPERATURE, regime, -residual_k, False)


def _load(watch: Watch, given: Given, sample: Sample) -> Compared | str | None:
    load_pct, why = sample.number(LOAD)
    rpm, no_rpm = sample.number(SPEED)
    if load_pct is None or rpm is None:
        return why or no_rpm or ""
    if watch.feeding is _UNKNOWN:
        return sample.number(FEED)[1] or f"{FEED} is not known"
    since_s = max(watch.rpm_since_s, watch.feeding_since_s)
    if abs(rpm) < TURNING_RPM_MIN or sample.at_s < since_s + given.settle_s:
        return None
    if watch.feeding is not _FEED:
        twin_pct = given.idle_load_pct
        return Compared(LOAD, "air", (twin_pct or 0.0) - load_pct, twin_pct is None)
    if not _runs(sample):
        return None
    program = sample.row.get(PROGRAM)
    if program is None or program.quality is not Quality.GOOD or not isinstance(program.value, str) or not program.value.strip():
        return f"{PROGRAM} is not known: what the load in the cut should be depends on it"
    return Compared(LOAD, f"cutting {program.value.strip()[:PROGRAM_CHARACTERS_MAX]}", -load_pct, True)


def _speed(watch: Watch, given: Given, sample: Sample) -> Compared | str | None:
    rpm, why = sample.number(SPEED)
    command_rpm, no_command = sample.number(COMMAND)
    if rpm is None or command_rpm is None:
        return why or no_command or ""
    is_settled = sample.at_s >= watch.rpm_since_s + given.settle_s
    if not is_settled or abs(rpm) < TURNING_RPM_MIN or abs(command_rpm) < TURNING_RPM_MIN:
        return None
    return Compared(SPEED, "turning", abs(command_rpm) - abs(rpm), False)


def _at_rest(watch: Watch, given: Given, sample: Sample, signal: str) -> Compared | str | None:
    load_pct, why = sample.number(signal)
    if load_pct is None:
        return why or ""
    if watch.feeding is _UNKNOWN:
        return sample.number(FEED)[1] or f"{FEED} is not known"
    if watch.feeding is not _REST or sample.at_s < watch.feeding_since_s + given.settle_s or not _runs(sample):
        return None
    return Compared(signal, "standstill", -load_pct, True)


def _runs(sample: Sample) -> bool:
    """Return True if a program runs, so that the drives are on; where nobody tells, it is taken to be so."""
    state = sample.row.get(EXECUTION)
    return state is None or (state.quality is Quality.GOOD and state.value == "ACTIVE")


def _feeding(given: Given, sample: Sample) -> Feeding:
    feed_mm_min, _ = sample.number(FEED)
    if feed_mm_min is None:
        return _UNKNOWN
    if abs(feed_mm_min) < FEED_MM_MIN_MIN:
        return _REST
    return _FEED if abs(feed_mm_min) < given.rapid_feed_mm_min else _RAPID


def _change(sample: Sample) -> ToolChange:
    """Return the report of the control, else of the detector; ABSENT where neither does."""
    said = tool_change_context(sample.row)
    if said.active is not None and said.source != STALE:
        return ToolChange.ACTIVE if said.active else ToolChange.NONE
    control, detected, source = sample.row.get(CHANGE), sample.row.get(DETECTED), sample.row.get(CHANGE_SOURCE)
    if detected is None and (control is None or (source is not None and source.value == NOBODY)):
        return ToolChange.ABSENT
    return ToolChange.UNKNOWN
