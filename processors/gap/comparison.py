"""The live twin beside the measurement, signal by signal, and the regime: twin minus measured at one moment.

| signal | regime | the twin |
|---|---|---|
| spindle_temp_c | warm_up, steady, cool_down, by the modelled heat | the description's heat, as `thermal` publishes it |
| spindle_load_pct | air: the spindle turns, no feed or a rapid one | the description's load in air at that speed; else learned |
| spindle_load_pct | cutting, for each program | learned |
| spindle_rpm | turning | spindle_rpm_cmd |
| tool_change_s | spindle_stopped: it stood when the change began | the description's `[program] tool_change_s`; else learned |
| tool_change_s | spindle_turning | learned |
| program_time_s | each section between tool changes, by program | planned by `cnctwin twin programs`; else learned |
| axis_{a}_load_pct | standstill: no feed, a program runs | learned |

Nothing but times is compared during a tool change and until settle_s after it; load, speed and axes not until settle_s after a
change of speed or feed either.
"""

from typing import NamedTuple

from processors.gap.described import Given
from processors.gap.signals import AXIS_LOADS, LOAD, PROGRAM_TIME, SIGNALS, SPEED, TEMPERATURE, TOOL_CHANGE
from processors.gap.timing import OVERRIDES, Timed
from processors.gap.watch import (
    CHANGE_SOURCE,
    EXECUTION,
    FEED,
    GAP_MAX,
    HEAT_BASIS,
    PROGRAM,
    PROGRAM_CHARACTERS_MAX,
    RISE,
    TURNING_RPM_MIN,
    Feeding,
    ToolChange,
    Watch,
    is_heat_of,
)
from processors.sample import Sample
from processors.tool_change_detector.context import ACTIVE as CHANGE
from processors.tool_change_detector.context import DETECTED
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals

COMMAND = "spindle_rpm_cmd"
RESIDUAL = twin_signals.SPINDLE_TEMP_RESIDUAL_K
INPUTS = frozenset(
    {
        *(SPEED, COMMAND, FEED, LOAD, RESIDUAL, RISE, HEAT_BASIS, CHANGE, DETECTED, CHANGE_SOURCE, EXECUTION, PROGRAM),
        *OVERRIDES,
        *AXIS_LOADS,
    }
)
HEATING_K = 0.5
"""Warm-up: the modelled rise is so far above its own mean (`processors/gap/watch.py`)."""
_UNKNOWN, _REST, _FEED = Feeding.UNKNOWN, Feeding.REST, Feeding.FEED


class Compared(NamedTuple):
    """Twin minus measured; where the baseline is learned, minus measured. seconds: as how many it counts, None = as a tick"""

    signal: str
    regime: str
    gap: float
    is_learned: bool
    seconds: float | None = None


class Comparison(NamedTuple):
    """The comparisons of one moment, and by signal why there is none, where an input was missing."""

    compared: tuple[Compared, ...]
    missing: dict[str, str]
    is_left_out: bool


def comparison(watch: Watch, given: Given, sample: Sample) -> Comparison:
    """Return the comparisons of this moment."""
    if watch.change is ToolChange.UNKNOWN:
        return Comparison((), dict.fromkeys(SIGNALS, f"{CHANGE} is not known: the samples cannot be gated"), True)
    found = {
        TEMPERATURE: _temperature(watch, given, sample),
        LOAD: _load(watch, given, sample),
        SPEED: _speed(watch, given, sample),
        TOOL_CHANGE: f"{CHANGE} is not offered" if watch.change is ToolChange.ABSENT else None,
        PROGRAM_TIME: _no_program(sample),
    }
    found |= {signal: _at_rest(watch, given, sample, signal) for signal in AXIS_LOADS}
    missing = {signal: why for signal, why in found.items() if isinstance(why, str)}
    is_gated = watch.change is ToolChange.ACTIVE or (
        watch.change is ToolChange.NONE and sample.at_s < watch.change_since_s + given.config.settle_s
    )
    if is_gated:
        return Comparison((), missing, True)
    compared = tuple(one for one in found.values() if isinstance(one, Compared) and abs(one.gap) <= GAP_MAX)
    return Comparison(compared, missing, not compared)


def times_compared(given: Given, done: tuple[Timed, ...]) -> tuple[Compared, ...]:
    """Return the comparisons of what has taken time and ended."""
    return tuple(_time(given, one) for one in done)


def _time(given: Given, one: Timed) -> Compared:
    if one.signal == TOOL_CHANGE:
        twin_s = given.twin.tool_change_s if one.is_stopped else None
    else:
        twin_s = given.section_s(one.program, one.section)
    return Compared(one.signal, one.regime, (twin_s or 0.0) - one.seconds, twin_s is None, one.weight_s)


def _temperature(watch: Watch, given: Given, sample: Sample) -> Compared | str | None:
    if not is_heat_of(given.twin.version, sample):
        return f"{RESIDUAL} is of another description as yet"
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
    if abs(rpm) < TURNING_RPM_MIN or sample.at_s < since_s + given.config.settle_s:
        return None
    if watch.feeding is not _FEED:
        idle_pct = given.twin.idle_load_pct
        return (
            Compared(LOAD, "air", -load_pct, True)
            if idle_pct is None
            else Compared(LOAD, "air", idle_pct(abs(rpm)) - load_pct, False)
        )
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
    is_settled = sample.at_s >= watch.rpm_since_s + given.config.settle_s
    if not is_settled or abs(rpm) < TURNING_RPM_MIN or abs(command_rpm) < TURNING_RPM_MIN:
        return None
    return Compared(SPEED, "turning", abs(command_rpm) - abs(rpm), False)


def _at_rest(watch: Watch, given: Given, sample: Sample, signal: str) -> Compared | str | None:
    load_pct, why = sample.number(signal)
    if load_pct is None:
        return why or ""
    if watch.feeding is _UNKNOWN:
        return sample.number(FEED)[1] or f"{FEED} is not known"
    if watch.feeding is not _REST or sample.at_s < watch.feeding_since_s + given.config.settle_s or not _runs(sample):
        return None
    return Compared(signal, "standstill", -load_pct, True)


def _no_program(sample: Sample) -> str | None:
    """Return why no program can be timed; None where it can."""
    absent = next((name for name in (EXECUTION, PROGRAM) if name not in sample.row), None)
    return None if absent is None else f"{absent} is not offered"


def _runs(sample: Sample) -> bool:
    """Return True if a program runs, so that the drives are on; where nobody tells, it is taken to be so."""
    state = sample.row.get(EXECUTION)
    return state is None or (state.quality is Quality.GOOD and state.value == "ACTIVE")
